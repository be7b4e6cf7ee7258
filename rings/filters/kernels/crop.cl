#include "common.clh"

// The window of h x w pixels that begins at (left, top).
__kernel void crop(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int left, const int top)
{
    GRID_3(k, y, x, K, h, w)
    out[(k * h + y) * w + x] = light[(k * H + top + y) * W + left + x];
}
