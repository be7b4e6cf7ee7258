#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define REACH 2

// Binomial mean over 5 x 5 pixels; the border is repeated.  A work-item does LANES pixels of TALL
// rows, each of whose means along the row serves five of them.
LANED __kernel void smooth_light(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    const float taps[2 * REACH + 1] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
    const int blocks = (H + TALL - 1) / TALL;
    GRID_PARTS_OF_ROWS(block, x, count, K * blocks, W)
    const int k = block / blocks, top = TALL * (block - k * blocks);
    __global const float *plane = light + k * H * W;
    floats along[TALL + 2 * REACH];
    for (int j = 0; j < TALL + 2 * REACH; ++j) {
        __global const float *row = plane + within_border(top + j - REACH, H, REPLICATE) * W;
        along[j] = 0.0f;
        for (int i = 0; i < 2 * REACH + 1; ++i)
            along[j] += taps[i] * load_within_border(row, x + i - REACH, count, W, REPLICATE);
    }
    for (int y = 0; y < min(TALL, H - top); ++y) {
        floats total = 0.0f;
        for (int j = 0; j < 2 * REACH + 1; ++j) total += taps[j] * along[y + j];
        store_floats(total, out + (k * H + top + y) * W + x, count);
    }
}
