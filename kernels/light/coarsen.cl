#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "cells.clh"
#include "cell_side.clh"

// The mean, or the first, of every cell of side x side pixels; beyond the border the border pixels
// repeat.  A work-item does LANES cells of a row.
LANED __kernel void coarsen(
    __global const PIXEL *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int factor,
    const int sample)
{
    GRID_PARTS_OF_ROWS(line, column, count, K * h, w)
    const int k = line / h, row = line - k * h, side = cell_side(H, W, factor);
    __global const PIXEL *plane = light + k * H * W;
    __global float *cells = out + line * w + column;
    if (sample) {
        for (int l = 0; l < count; ++l) {
            const PIXEL corner = plane[row * side * W + (column + l) * side];
            cells[l] = convert_float(corner) / (float)FULL;
        }
        return;
    }
    store_floats(mean_of_cells(plane, row, column, H, W, side), cells, count);
}
