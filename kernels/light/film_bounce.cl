#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "radiosity.clh"
#include "film.clh"
#include "coated_bounce.clh"
#include "sweep.clh"

// The light of cells interpolated at pixels, with a correction for what they miss, from cells twice
// as large; and relaxed from the previous result by `share`.
LANED __kernel void interpolate(
    __global const float *restrict bounced,
    __global const float *restrict of_larger,
    __global const float *restrict before,
    __global float *restrict out,
    const int H, const int W,
    const int factor,
    const int h, const int w,
    const float share)
{
    GRID_PARTS_OF_ROWS(line, x, count, LEDS * H, W)
    const int k = line / H, y = line - k * H;
    floats found =
        extrapolated(bounced, of_larger, k, y, x, count, factor, h, w);
    const int i = line * W + x;
    if (before) {
        const floats earlier = load_floats(before + i, count);
        found = earlier + share * (found - earlier);
    }
    store_floats(found, out + i, count);
}
