#include "common.clh"

#define DARKEST 0.02f

// Light over the drift of its LED, a polynomial in the place: film_drift.
__kernel void level_light(
    __global const float *restrict light,
    __global const float *restrict drift,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    const float scale = 2.0f / (float)W;
    const float u = ((float)x - 0.5f * (float)(W - 1)) * scale;
    const float v = ((float)y - 0.5f * (float)(H - 1)) * scale;
    __global const float *c = drift + 6 * k;
    const float gain = c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v;
    const int i = (k * H + y) * W + x;
    out[i] = light[i] / fmax(gain, DARKEST);
}
