#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "group.clh"

#define MIN_TESTED_SLOPE 0.1f
#define BLOCK_PX 16
#define MAX_LEDS 8
#define LIGHT_NOISE_SHARE 0.01f

// The residual of the light under a normal and the film's brightness, and 1 where all LEDs are used
// on tilted film, else 0.
LANED __kernel void leave(
    __global const float *restrict light, __global const float *restrict slope,
    __global const float *restrict height, __global const uchar *restrict used,
    __global const float *restrict lights, __global float *restrict excess,
    __global float *restrict counts, const int K, const int H, const int W, const float pixel,
    const float uneven)
{
    const int size = H * W;
    GRID_LANES(at, count, size)
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats z = load_floats(height + at, count), none = 0.0f, one = 1.0f;
    const ints tilted = p * p + q * q > MIN_TESTED_SLOPE * MIN_TESTED_SLOPE;
    const ints tells = (load_bytes(used + at, count) == (1 << K) - 1) & tilted;
    const floats nz = 1.0f / sqrt(1.0f + p * p + q * q);
    floats x, y;
    places(at, H, W, pixel, &x, &y);
    floats shown[MAX_LEDS], departs[MAX_LEDS], along = 0.0f, whole = 0.0f;
    for (int k = 0; k < K; ++k) {
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        shown[k] = (v.z - v.x * p - v.y * q) * nz;
        departs[k] = load_floats(light + k * size + at, count) - shown[k];
        along += shown[k] * departs[k];
        whole += shown[k] * shown[k];
    }
    const float noise = LIGHT_NOISE_SHARE * LIGHT_NOISE_SHARE;
    const floats brighter = along * brightness_share(whole, noise, uneven);
    for (int k = 0; k < K; ++k) {
        const floats rest = departs[k] - brighter * shown[k];
        store_floats(tells ? rest : none, excess + k * size + at, count);
    }
    store_floats(tells ? one : none, counts + at, count);
}

// Over blocks of pixels, the sums of products with neighbours `lag` pixels away, and of pairs.
LANED __kernel void add_blocks(
    __global const float *restrict excess, __global const float *restrict counts,
    __global float *restrict total, __global float *restrict number, const int K, const int H,
    const int W, const int lag, const int rows, const int columns)
{
    GRID_2(row, column, rows, columns)
    const int size = H * W, corner = (row * W + column) * BLOCK_PX;
    floats product = 0.0f, pairs = 0.0f;
    for (int y = 0; y < BLOCK_PX; ++y)
        for (int x = 0; x < BLOCK_PX; x += LANES) {
            const int i = corner + y * W + x;
            for (int k = 0; k < K; ++k) {
                __global const float *here = excess + k * size + i;
                product += LOAD_LANES(here) * (LOAD_LANES(here + lag * W) + LOAD_LANES(here + lag));
            }
            pairs += LOAD_LANES(counts + i) *
                     (LOAD_LANES(counts + i + lag * W) + LOAD_LANES(counts + i + lag));
        }
    total[row * columns + column] = sum_of_lanes(product) / (float)K;
    number[row * columns + column] = sum_of_lanes(pairs);
}

// Over blocks of pixels, the departure of each LED's light on the film at rest from its model, and
// the number of pixels at rest.
LANED __kernel void rest_blocks(
    __global const float *restrict light, __global const float *restrict height,
    __global const float *restrict lights, __global const uchar *restrict rest,
    __global const float *tilt, __global float *restrict total, __global float *restrict number,
    const int K, const int H, const int W, const float pixel, const int rows, const int columns)
{
    GRID_3(k, row, column, K, rows, columns)
    const int size = H * W, corner = (row * W + column) * BLOCK_PX;
    floats departs = 0.0f, pixels = 0.0f;
    for (int v = 0; v < BLOCK_PX; ++v)
        for (int u = 0; u < BLOCK_PX; u += LANES) {
            const int i = corner + v * W + u;
            const floats none = 0.0f, one = 1.0f;
            const floats p = tilt ? LOAD_LANES(tilt + i) : none;
            const floats q = tilt ? LOAD_LANES(tilt + size + i) : none;
            floats x, y;
            places(i, H, W, pixel, &x, &y);
            const Vector led = light_vector(lights + 3 * k, x, y, LOAD_LANES(height + i));
            const floats shown = (led.z - led.x * p - led.y * q) / sqrt(1.0f + p * p + q * q);
            const ints calm = load_bytes(rest + i, LANES) != 0;
            departs += calm ? LOAD_LANES(light + k * size + i) - shown : none;
            pixels += calm ? one : none;
        }
    total[(k * rows + row) * columns + column] = sum_of_lanes(departs);
    if (k == 0) number[row * columns + column] = sum_of_lanes(pixels);
}
