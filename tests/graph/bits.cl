#include "common.clh"

__kernel void bits(
    __global const uchar *restrict labels,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = labels[i];
}
