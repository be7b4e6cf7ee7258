#include "common.clh"
#include "lanes.clh"

// Slopes less those of the film at rest.
LANED __kernel void slope_from_rest(
    __global const float *restrict slope,
    __global const float *restrict tilt,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_LANES(at, count, H * W)
    for (int axis = 0; axis < 2; ++axis) {
        const int i = axis * H * W + at;
        floats found = load_floats(slope + i, count);
        if (tilt) found -= load_floats(tilt + i, count);
        store_floats(found, out + i, count);
    }
}
