#include "common.clh"

// Central differences of the height, one-sided at the border; too steep is masked out.
__kernel void height_slopes(
    __global const float *restrict height,
    const float pixel,
    __global float *restrict slope,
    __global uchar *restrict mask,
    const int H, const int W,
    const float steepest)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    const int right = min(x + 1, W - 1), left = max(x - 1, 0);
    const int below = min(y + 1, H - 1), above = max(y - 1, 0);
    const float p = (height[y * W + right] - height[y * W + left]) / max(right - left, 1) / pixel;
    const float q = (height[below * W + x] - height[above * W + x]) / max(below - above, 1) / pixel;
    slope[i] = p;
    slope[H * W + i] = q;
    mask[i] = p * p + q * q <= steepest * steepest;
}
