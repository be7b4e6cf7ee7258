#include "common.clh"

__kernel void summed(
    __global const float *restrict image,
    __global const float *restrict before,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = before ? image[i] + before[i] : image[i];
}
