#include "common.clh"

// The highest, or lowest, of 2 radius + 1 pixels along a row or a column; pixels beyond the
// frame do not count.
__kernel void extreme_along(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius, const int in_row, const int highest)
{
    GRID_3(k, y, x, K, H, W)
    const int at = in_row ? x : y, last = (in_row ? W : H) - 1, stride = in_row ? 1 : W;
    const int i = (k * H + y) * W + x;
    float result = light[i];
    for (int j = max(at - radius, 0); j <= min(at + radius, last); ++j) {
        const float value = light[i + (j - at) * stride];
        result = highest ? fmax(result, value) : fmin(result, value);
    }
    out[i] = result;
}

// 1 - I / closing(I), the least over the LEDs.
__kernel void darkness(
    __global const float *restrict light,
    __global const float *restrict closed,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float darkest)
{
    GRID_2(y, x, H, W)
    float result = INFINITY;
    for (int k = 0; k < K; ++k) {
        const int i = (k * H + y) * W + x;
        result = fmin(result, 1.0f - light[i] / fmax(closed[i], darkest));
    }
    out[y * W + x] = fmax(result, 0.0f);
}
