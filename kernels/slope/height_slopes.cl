#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// Central differences of the height, one-sided at the border; pixels that are too steep are masked
// out.
LANED __kernel void height_slopes(
    __global const float *restrict height, const float pixel, __global float *restrict slope,
    __global uchar *restrict mask, const int H, const int W, const float steepest)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int i = y * W + x, below = min(y + 1, H - 1), above = max(y - 1, 0);
    __global const float *row = height + y * W;
    const floats one = 1.0f, two = 2.0f, column = (float)x + LANE_NUMBERS;
    const floats across = (column == 0.0f | column == (float)(W - 1)) ? one : two;
    const floats p = (load_within_border(row, x + 1, count, W, REPLICATE) -
                      load_within_border(row, x - 1, count, W, REPLICATE)) / across / pixel;
    const floats q = (load_floats(height + below * W + x, count) -
                      load_floats(height + above * W + x, count)) /
                     (float)max(below - above, 1) / pixel;
    const ints gentle = p * p + q * q <= steepest * steepest, yes = 1, no = 0;
    store_floats(p, slope + i, count);
    store_floats(q, slope + H * W + i, count);
    store_bytes(gentle ? yes : no, mask + i, count);
}
