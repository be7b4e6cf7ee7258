#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "between_cells.clh"
#include "radiosity.clh"
#include "film.clh"
#define SEEN_FROM_ABOVE
#include "coated_bounce.clh"
#include "sweep.clh"

#define MIN_REST_LIGHT 1e-6f

// Light relative to the film at rest.
LANED __kernel void relative(
    __global const float *restrict light,
    __global const float *restrict rest,
    __global float *restrict out,
    const int N)
{
    GRID_LANES(i, count, N)
    const floats least = MIN_REST_LIGHT, level = load_floats(rest + i, count);
    store_floats(load_floats(light + i, count) / MORE_OF(level, least), out + i, count);
}

// The light of a cell of the frame: from the LEDs, and from film to film.
__kernel void add_bounce(
    __global const float *restrict direct,
    __global const float *restrict bounced,
    __global float *restrict table,
    const int h, const int w, const int rim)
{
    GRID_1(i, h * w)
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    const int row = i / w, cell = (row + rim) * columns + rim + i - row * w;
    for (int k = 0; k < LEDS; ++k) {
        const int at = (CELL_LIGHT + k) * N + cell;
        table[at] = direct[at] + direct[(CELL_REST + k) * N + cell] * bounced[k * h * w + i];
    }
}

// Adds the bounces to the light.
LANED __kernel void add_light(
    __global const float *restrict light,
    __global const float *restrict rest,
    __global const float *restrict bounced,
    __global float *restrict out,
    const int H, const int W,
    const int factor,
    const int h, const int w)
{
    GRID_PARTS_OF_ROWS(line, x, count, LEDS * H, W)
    const int k = line / H, y = line - k * H, i = line * W + x;
    const floats none = 0.0f, added = between_cells(bounced + k * h * w, y, x, count, factor, h, w);
    const floats sum = load_floats(light + i, count) + load_floats(rest + i, count) * added;
    store_floats(MORE_OF(sum, none), out + i, count);
}
