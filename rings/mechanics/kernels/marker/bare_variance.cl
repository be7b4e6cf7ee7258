#include "common.clh"

// One variance of p and q on bare film, another under markers.
__kernel void bare_variance(
    __global const uchar *restrict bare,
    __global float *restrict out,
    const int H, const int W,
    const float film, const float marker)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    out[i] = out[H * W + i] = bare[i] ? film : marker;
}
