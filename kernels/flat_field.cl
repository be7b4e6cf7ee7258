#include "common.clh"
#include "lanes.clh"

// Light relative to the film at rest, per LED: (image - dark) / flat.
__kernel void flat_field(
    __global const float *restrict image,
    __global const float *restrict flat,
    __global const float *restrict dark,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float floor_)
{
    GRID_LANES(pixel, count, H * W)
    const floats low = floor_, level = load_floats(dark + pixel, count);
    for (int k = 0; k < K; ++k) {
        const int i = k * H * W + pixel;
        const floats rest = load_floats(flat + i, count);
        const floats lit = load_floats(image + i, count) - level;
        store_floats(lit / MORE_OF(rest, low), out + i, count);
    }
}
