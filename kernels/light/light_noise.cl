#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"

// Fraction of full scale that a camera of 8 bits rounds to full scale.
#define SATURATED_LIGHT 0.998f

// Standard deviation of the light relative to the film at rest: shot and read noise, and full
// scale for a saturated pixel.
LANED __kernel void light_noise(
    __global const PIXEL *restrict image,
    __global const float *restrict flat,
    __global const float *restrict noise,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float floor_)
{
    GRID_LANES(pixel, count, H * W)
    const floats low = floor_, none = 0.0f, all = 1.0f;
    for (int k = 0; k < K; ++k) {
        const int i = k * H * W + pixel;
        const floats light = load_fractions(image + i, count), rest = load_floats(flat + i, count);
        const floats unknown = light >= SATURATED_LIGHT ? all : none;
        const floats variance = noise[0] * MORE_OF(light, none) + (noise[1] + unknown);
        store_floats(sqrt(variance) / MORE_OF(rest, low), out + i, count);
    }
}
