#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "drift.clh"

// Light divided by the drift of its LED.
LANED __kernel void level_light(
    __global const float *restrict light,
    __global const float *restrict drift,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_LANES(pixel, count, H * W)
    floats u, v;
    places(pixel, H, W, 2.0f / (float)W, &u, &v);
    for (int k = 0; k < K; ++k) {
        const int i = k * H * W + pixel;
        store_floats(load_floats(light + i, count) / drift_gain(drift, k, u, v), out + i, count);
    }
}
