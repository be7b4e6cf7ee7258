#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// A sum weighted with 2 * radius + 1 taps along a row, then along a column; a work-item does
// LANES pixels of a row.
LANED __kernel void blur_rows(
    __global const float *restrict light,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const int border)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    __global const float *row = light + line * W;
    floats total = 0.0f;
    for (int i = -radius; i <= radius; ++i)
        total += taps[i + radius] * load_within_border(row, x + i, count, W, border);
    store_floats(total, out + line * W + x, count);
}

LANED __kernel void blur_columns(
    __global const float *restrict light,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const int border)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, y = line - k * H;
    __global const float *plane = light + k * H * W;
    floats total = 0.0f;
    for (int i = -radius; i <= radius; ++i) {
        __global const float *row = plane + within_border(y + i, H, border) * W;
        total += taps[i + radius] * load_floats(row + x, count);
    }
    store_floats(total, out + line * W + x, count);
}
