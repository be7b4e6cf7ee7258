#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define REACH 2

// Binomial mean over 5 x 5 pixels; the border is repeated.  A work-item does LANES pixels of
// ITEM_ROWS rows, each of whose means along the row serves five of them.
LANED __kernel void smooth_slope(
    __global const float *restrict slope,
    __global float *restrict out,
    const int H, const int W)
{
    const float taps[2 * REACH + 1] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
    const int blocks = (H + ITEM_ROWS - 1) / ITEM_ROWS;
    GRID_PARTS_OF_ROWS(block, x, count, 2 * blocks, W)
    const int k = block / blocks, top = ITEM_ROWS * (block - k * blocks);
    __global const float *plane = slope + k * H * W;
    floats along[ITEM_ROWS + 2 * REACH];
    for (int j = 0; j < ITEM_ROWS + 2 * REACH; ++j) {
        __global const float *row = plane + within_border(top + j - REACH, H, REPLICATE) * W;
        along[j] = 0.0f;
        for (int i = 0; i < 2 * REACH + 1; ++i)
            along[j] += taps[i] * load_within_border(row, x + i - REACH, count, W, REPLICATE);
    }
    for (int y = 0; y < min(ITEM_ROWS, H - top); ++y) {
        floats total = 0.0f;
        for (int j = 0; j < 2 * REACH + 1; ++j) total += taps[j] * along[y + j];
        store_floats(total, out + (k * H + top + y) * W + x, count);
    }
}
