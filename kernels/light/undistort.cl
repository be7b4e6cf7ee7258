#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "lens.clh"
#include "bicubic.clh"

// Images on the ideal grid.  A work-item does LANES pixels of a row, of all LEDs.
LANED __kernel void undistort(
    __global const PIXEL *restrict image,
    __global const float *restrict lens,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column, bent = is_bent(lens);
    Taps taps;
    if (bent) {
        floats x, y;
        camera_places(lens, row, column, H, W, &x, &y);
        find_taps(x, y, column, H, W, &taps);
    }
    for (int k = 0; k < K; ++k) {
        __global const PIXEL *plane = image + k * H * W;
        const floats light = bent ? TO_FRACTIONS_OF_FLOATS(value_at(plane, &taps, H, W))
                                  : load_fractions(plane + at, count);
        store_floats(light, out + k * H * W + at, count);
    }
}
