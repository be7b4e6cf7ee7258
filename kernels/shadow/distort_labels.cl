#include "common.clh"
#include "lanes.clh"
#include "lens.clh"

// The labels that each pixel of the camera sees: those of the nearest ideal pixel.
LANED __kernel void distort_labels(
    __global const uchar *restrict labels,
    __global const float *restrict lens,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column;
    if (!is_bent(lens)) {
        store_bytes(load_bytes(labels + at, count), out + at, count);
        return;
    }
    int from[LANES];
    nearest_ideal(lens, row, column, H, W, from);
    for (int l = 0; l < count; ++l) out[at + l] = labels[from[l]];
}
