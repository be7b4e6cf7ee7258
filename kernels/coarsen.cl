#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "cells.clh"

// The mean, or the first, of every cell of factor x factor pixels; beyond the border its pixels
// count again.
__kernel void coarsen(
    __global const PIXEL *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int factor,
    const int take)
{
    GRID_3(k, row, column, K, h, w)
    __global const PIXEL *plane = light + k * H * W;
    const int x = column * factor, cell = (k * h + row) * w + column;
    if (take) {
        out[cell] = FRACTION(convert_float, plane[row * factor * W + x]);
        return;
    }
    out[cell] = mean_of_cell(plane, row, column, H, W, factor);
}
