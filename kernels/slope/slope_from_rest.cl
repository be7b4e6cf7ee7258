#include "common.clh"
#include "lanes.clh"

// Slopes minus those of the film at rest, or plus them.
LANED __kernel void slope_from_rest(
    __global const float *restrict slope, __global const float *restrict tilt,
    __global float *restrict out, const int H, const int W, const int inverse)
{
    GRID_LANES(at, count, H * W)
    for (int axis = 0; axis < 2; ++axis) {
        const int i = axis * H * W + at;
        floats result = load_floats(slope + i, count);
        if (tilt) {
            const floats rest = load_floats(tilt + i, count);
            result = inverse ? result + rest : result - rest;
        }
        store_floats(result, out + i, count);
    }
}
