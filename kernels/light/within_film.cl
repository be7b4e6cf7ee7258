#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"

// The images, with the film at rest where the frame shows no film.
LANED __kernel void within_film(
    __global const PIXEL *restrict image,
    __global const uchar *restrict area,
    __global const float *restrict flat,
    __global const float *restrict dark,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_LANES(pixel, count, H * W)
    const ints shown = load_bytes(area + pixel, count);
    const floats level = load_floats(dark + pixel, count);
    for (int k = 0; k < K; ++k) {
        const int i = k * H * W + pixel;
        const floats rest = load_floats(flat + i, count) + level;
        store_floats(shown != 0 ? load_fractions(image + i, count) : rest, out + i, count);
    }
}
