#include "common.clh"

__kernel void strips(
    __global const float *restrict image,
    __global float *restrict out,
    const int K, const int H, const int W, const int h,
    const int rows)
{
    GRID_3(k, y, x, K, h, W)
    float most = 0.0f;
    for (int j = y * rows; j < min((y + 1) * rows, H); ++j)
        most = fmax(most, image[(k * H + j) * W + x]);
    out[(k * h + y) * W + x] = most;
}
