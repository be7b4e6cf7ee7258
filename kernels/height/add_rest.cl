#include "common.clh"
#include "lanes.clh"

// The height of the film at rest, added or subtracted.
LANED __kernel void add_rest(
    __global const float *restrict height,
    __global const float *restrict rest,
    __global float *restrict out,
    const int H, const int W,
    const int inverse)
{
    GRID_LANES(i, count, H * W)
    const floats own = load_floats(height + i, count);
    if (!rest) {
        store_floats(own, out + i, count);
        return;
    }
    const floats low = load_floats(rest + i, count);
    store_floats(inverse ? own - low : own + low, out + i, count);
}
