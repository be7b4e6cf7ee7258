#include "common.clh"

__kernel void halves(
    __global const float *restrict image,
    const float stray,
    __global float *restrict low,
    __global float *restrict high,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    if (low) low[i] = image[i] * 0.5f + stray;
    if (high) high[i] = image[i] * 1.5f + stray;
}
