#include "common.clh"

// A filter along one axis of every plane; border pixels are replicated.
__kernel void spread(
    __global const float *restrict light,
    __global const float *restrict weights,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius, const int along_x)
{
    GRID_3(k, y, x, K, H, W)
    __global const float *plane = light + k * H * W;
    float total = 0.0f;
    for (int i = -radius; i <= radius; ++i) {
        const int row = along_x ? y : clamp(y + i, 0, H - 1);
        const int column = along_x ? clamp(x + i, 0, W - 1) : x;
        total += weights[i + radius] * plane[row * W + column];
    }
    out[(k * H + y) * W + x] = total;
}
