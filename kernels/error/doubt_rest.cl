#include "common.clh"
#include "lanes.clh"

// The height's standard deviation with the errors that entire maps share, on the film at rest; from
// a height that was not held at zero.
LANED __kernel void doubt_rest(
    __global const float *restrict error, __global const uchar *restrict rest,
    __global const float *restrict free, __global const float *restrict variance,
    const float pixel, __global const float *restrict apart,
    __global const float *restrict height, __global const float *restrict skirt,
    const float scale_error, const float zero,
    __global float *restrict out, const int H, const int W, const float level,
    const float steepest)
{
    const int size = H * W;
    GRID_LANES(at, count, size)
    const floats z = load_floats(free + at, count), wide = z * z;
    const floats away = load_floats(apart + at, count), moved = away * away;
    const floats stated = load_floats(error + at, count);
    const floats most = 2.0f * steepest * steepest;
    const floats both = load_floats(variance + at, count) + load_floats(variance + size + at, count);
    const float widest = level * pixel;
    const floats hidden = widest * widest / 6.0f * LESS_OF(both, most);
    const floats above = load_floats(height + at, count), scaled = scale_error * above;
    const floats held = MORE_OF(wide, moved) + hidden;
    const floats off = stated * stated + moved + scaled * scaled;
    const floats below = load_floats(skirt + at, count);
    const floats without_zero = (load_bytes(rest + at, count) != 0 ? held : off) + below * below;
    store_floats(sqrt(without_zero + zero * zero), out + at, count);
}
