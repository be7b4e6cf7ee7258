#include "common.clh"
#include "lanes.clh"
#include "lens.clh"

// The confidence in the labels at each pixel of the camera.
LANED __kernel void distort_confidence(
    __global const float *restrict confidence,
    __global const float *restrict lens,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column;
    if (!is_bent(lens)) {
        store_floats(load_floats(confidence + at, count), out + at, count);
        return;
    }
    int from[LANES];
    nearest_ideal(lens, row, column, H, W, from);
    for (int l = 0; l < count; ++l) out[at + l] = confidence[from[l]];
}
