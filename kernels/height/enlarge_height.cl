#include "common.clh"
#include "lanes.clh"
#include "cell_side.clh"
#include "pixels.clh"

// The height of coarse cells, interpolated linearly between their centres, plus another height if
// given. A work-item does LANES pixels of a row.
LANED __kernel void enlarge_height(
    __global const float *restrict height,
    __global const PIXEL *restrict like,
    __global const float *restrict onto,
    __global float *restrict out,
    const int h, const int w,
    const int K, const int H, const int W,
    const int factor)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const float side = (float)cell_side(H, W, factor);
    const float row =
        clamp(((float)y + 0.5f) / side - 0.5f, 0.0f, (float)(h - 1));
    const floats none = 0.0f, last = (float)(w - 1);
    const floats column = LESS_OF(
        MORE_OF(((float)x + LANE_NUMBERS + 0.5f) / side - 0.5f, none), last);
    const int above = (int)row;
    const ints first = TO_INTS(column), edge = w - 1;
    int left[LANES], right[LANES];
    STORE_LANES(first, left);
    STORE_LANES(LESS_OF(first + 1, edge), right);
    __global const float *cells = height + above * w, *next = height + min(above + 1, h - 1) * w;
    const floats across = column - TO_FLOATS(first);
    const floats west = gather_floats(cells, left), south_west = gather_floats(next, left);
    const floats top = west + (gather_floats(cells, right) - west) * across;
    const floats bottom = south_west + (gather_floats(next, right) - south_west) * across;
    floats there = top + (bottom - top) * (row - (float)above);
    if (onto) there += load_floats(onto + y * W + x, count);
    store_floats(there, out + y * W + x, count);
}
