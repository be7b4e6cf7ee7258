#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "lens.clh"
#include "bicubic.clh"

// The height that each pixel of the camera sees.  A work-item does LANES pixels of a row.
LANED __kernel void distort_height(
    __global const float *restrict height,
    __global const float *restrict lens,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column;
    floats apparent;
    if (is_bent(lens)) {
        floats u, v;
        Taps taps;
        ideal_places(lens, row, column, H, W, &u, &v);
        find_taps(u, v, column, H, W, &taps);
        apparent = value_at(height, &taps, H, W);
    } else {
        apparent = load_floats(height + at, count);
    }
    store_floats(apparent, out + at, count);
}
