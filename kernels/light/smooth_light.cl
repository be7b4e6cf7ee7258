#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// Binomial mean over 5 x 5 pixels; the border is repeated.  A work-item does LANES pixels of a row.
LANED __kernel void smooth_light(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    const float taps[5] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, y = line - k * H;
    __global const float *plane = light + k * H * W;
    floats total = 0.0f;
    for (int j = 0; j < 5; ++j) {
        __global const float *row = plane + within_border(y + j - 2, H, REPLICATE) * W;
        floats along = 0.0f;
        for (int i = 0; i < 5; ++i)
            along += taps[i] * load_within_border(row, x + i - 2, count, W, REPLICATE);
        total += taps[j] * along;
    }
    store_floats(total, out + line * W + x, count);
}
