#include "common.clh"
#pragma OPENCL FP_CONTRACT ON
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "between_cells.clh"
#include "radiosity.clh"
#include "film.clh"
#include "coated_bounce.clh"
#include "sweep.clh"

// The light of cells interpolated at pixels, and relaxed from the previous result by `share`; without
// cells, that result.
LANED __kernel void interpolate(
    __global const float *restrict bounced,
    __global const float *restrict before,
    __global float *restrict out,
    const int H, const int W,
    const int factor,
    const int h, const int w,
    const float share)
{
    GRID_PARTS_OF_ROWS(line, x, count, LEDS * H, W)
    const int k = line / H, y = line - k * H, i = line * W + x;
    floats found = 0.0f;
    if (bounced) found = between_cells(bounced + k * h * w, y, x, count, factor, h, w);
    if (before) {
        const floats earlier = load_floats(before + i, count);
        found = earlier + share * (found - earlier);
    }
    store_floats(found, out + i, count);
}
