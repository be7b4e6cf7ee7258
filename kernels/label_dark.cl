#include "common.clh"

// A bit per LED that gives a pixel less light than `black`.
__kernel void label_dark(
    __global const float *restrict light,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const float black)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    uchar bits = 0;
    for (int k = 0; k < K; ++k)
        if (light[k * H * W + i] < black) bits |= 1 << k;
    out[i] = bits;
}
