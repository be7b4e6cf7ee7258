#include "common.clh"

// The weighted mean of two images.
__kernel void blend_images(
    __global const float *restrict first,
    __global const float *restrict second,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float share)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = first[i] * (1.0f - share) + second[i] * share;
}
