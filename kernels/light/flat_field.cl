#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "near_light.clh"
#include "drift.clh"

// Light relative to the film at rest, per LED: (image - dark) / flat, the flat image having
// drifted with its LED.
LANED __kernel void flat_field(
    __global const PIXEL *restrict image,
    __global const float *restrict flat,
    __global const float *restrict dark,
    __global const float *restrict drift,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float floor_)
{
    GRID_LANES(pixel, count, H * W)
    const floats low = floor_, level = load_floats(dark + pixel, count);
    floats u, v;
    places(pixel, H, W, 2.0f / (float)W, &u, &v);
    for (int k = 0; k < K; ++k) {
        const int i = k * H * W + pixel;
        floats rest = load_floats(flat + i, count);
        rest = MORE_OF(rest, low);
        if (drift) rest *= drift_gain(drift, k, u, v);
        store_floats((load_fractions(image + i, count) - level) / rest, out + i, count);
    }
}
