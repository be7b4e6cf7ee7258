#include "common.clh"

// One bit per LED that gives a pixel more light than `black` (which = 0), or does not (1).
__kernel void label_lit(
    __global const float *restrict light,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const float black, const int which)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    uchar bits = 0;
    for (int k = 0; k < K; ++k)
        if ((light[k * H * W + i] > black) != which) bits |= 1 << k;
    out[i] = bits;
}
