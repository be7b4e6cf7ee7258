#include "common.clh"
#include "lanes.clh"

// The film's height from that in the camera's view, equation V1.
LANED __kernel void undo_perspective(
    __global const float *restrict height,
    const float camera,
    __global const float *restrict rest,
    __global float *restrict out,
    const int H, const int W,
    const int inverse)
{
    GRID_LANES(at, count, H * W)
    const floats apparent = load_floats(height + at, count);
    const float by = inverse ? -camera : camera;
    if (!rest) {
        store_floats(apparent / (1.0f + by * apparent), out + at, count);
        return;
    }
    const floats low = load_floats(rest + at, count), whole = apparent + low;
    store_floats(whole / (1.0f + by * whole) - low / (1.0f + by * low), out + at, count);
}
