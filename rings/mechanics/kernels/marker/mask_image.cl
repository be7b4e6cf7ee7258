#include "common.clh"

// The light where the mask is set, else the value outside.
__kernel void mask_image(
    __global const float *restrict light,
    __global const uchar *restrict mask,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float outside)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = mask[y * W + x] ? light[i] : outside;
}
