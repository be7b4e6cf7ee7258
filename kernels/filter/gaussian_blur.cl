#include "common.clh"
#include "border.clh"

// A sum weighted with 2 * radius + 1 taps along a row, then along a column.
__kernel void blur_rows(
    __global const float *restrict light,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const int border)
{
    GRID_3(k, y, x, K, H, W)
    __global const float *row = light + (k * H + y) * W;
    float total = 0.0f;
    for (int i = -radius; i <= radius; ++i)
        total += taps[i + radius] * row[within_border(x + i, W, border)];
    out[(k * H + y) * W + x] = total;
}

__kernel void blur_columns(
    __global const float *restrict light,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const int border)
{
    GRID_3(k, y, x, K, H, W)
    __global const float *column = light + k * H * W + x;
    float total = 0.0f;
    for (int i = -radius; i <= radius; ++i)
        total += taps[i + radius] * column[within_border(y + i, H, border) * W];
    out[(k * H + y) * W + x] = total;
}
