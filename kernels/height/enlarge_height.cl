#include "common.clh"

// Where between the centres of two cells a pixel lies.
static float place_of(const int at, const int cells, const int factor)
{
    return clamp(((float)at + 0.5f) / (float)factor - 0.5f, 0.0f, (float)(cells - 1));
}

static float mixed(const float a, const float b, const float share)
{
    return a + (b - a) * share;
}

// The height of coarse cells, interpolated linearly.
__kernel void enlarge_height(
    __global const float *restrict height,
    __global const float *restrict like,
    __global float *restrict out,
    const int h, const int w,
    const int K, const int H, const int W,
    const int factor)
{
    GRID_2(y, x, H, W)
    const float row = place_of(y, h, factor), column = place_of(x, w, factor);
    const int above = (int)row, left = (int)column;
    const int below = min(above + 1, h - 1), right = min(left + 1, w - 1);
    const float across = column - (float)left;
    const float top = mixed(height[above * w + left], height[above * w + right], across);
    const float bottom = mixed(height[below * w + left], height[below * w + right], across);
    out[y * W + x] = mixed(top, bottom, row - (float)above);
}
