#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "radiosity.clh"
#include "film.clh"
#define SEEN_FROM_ABOVE
#include "coated_bounce.clh"

#define FAINTEST 1e-6f

// Light relative to the film at rest.
LANED __kernel void relative(
    __global const float *restrict light,
    __global const float *restrict rest,
    __global float *restrict out,
    const int N)
{
    GRID_LANES(i, count, N)
    const floats least = FAINTEST, level = load_floats(rest + i, count);
    store_floats(load_floats(light + i, count) / MORE_OF(level, least), out + i, count);
}

// The light of a cell of the frame: what the LEDs throw on it, and the film.
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

// What all cells throw on LANES cells of a row of the frame.
LANED __kernel void bounce(
    __global const float *restrict table,
    __global float *restrict bounced,
    const int h, const int w, const int rim,
    const float gain)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    __global const float *here = table + (row + rim) * columns + rim + column;
    const floats none = 0.0f;
    const floats px = load_floats(here, count), py = load_floats(here + N, count);
    const floats pz = load_floats(here + 2 * N, count);
    floats nx = load_floats(here + CELL_AREA * N, count);
    floats ny = load_floats(here + (CELL_AREA + 1) * N, count);
    floats nz = load_floats(here + (CELL_AREA + 2) * N, count);
    const floats length_ = sqrt(nx * nx + ny * ny + nz * nz);
    nx /= length_;
    ny /= length_;
    nz /= length_;
    floats total[LEDS];
    for (int k = 0; k < LEDS; ++k) total[k] = 0.0f;
    for (int j = 0; j < N; ++j) {
        __global const float *there = table + j;
        const floats dx = there[0] - px, dy = there[N] - py, dz = there[2 * N] - pz;
        const floats square = dx * dx + dy * dy + dz * dz + NEAREST;
        const floats arriving = nx * dx + ny * dy + nz * dz;
        const floats leaving = -(there[CELL_AREA * N] * dx + there[(CELL_AREA + 1) * N] * dy
                                 + there[(CELL_AREA + 2) * N] * dz);
        const floats factor =
            MORE_OF(arriving, none) * MORE_OF(leaving, none) / (square * square);
        for (int k = 0; k < LEDS; ++k) total[k] += factor * there[(CELL_LIGHT + k) * N];
    }
    for (int k = 0; k < LEDS; ++k) {
        const floats rest = load_floats(here + (CELL_REST + k) * N, count);
        store_floats(gain * total[k] / rest, bounced + (k * h + row) * w + column, count);
    }
}

// `bounce` of a film with a coat.
LANED __kernel void coated_bounce(
    __global const float *restrict table,
    __global const float *restrict sources,
    __global float *restrict bounced,
    __global const float *restrict lights, __global const float *restrict diffuse,
    const float base, const float roughness, const float refraction, const float camera,
    const int h, const int w, const int rim,
    const float gain)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const Film film = COATED_FILM;
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    const int at = (row + rim) * columns + rim + column;
    CoatedCells on = coated_cells(&film, sources + at, N, count);
    for (int j = 0; j < N; ++j) add_coated_source(&on, sources + j, N);
    throw_back(&on, table + at, N, bounced + row * w + column, h * w, gain, count);
}

// The bounces added to the light.
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
    const floats added = between_cells(bounced, k, y, x, count, factor, h, w);
    store_floats(load_floats(light + i, count) + load_floats(rest + i, count) * added, out + i, count);
}
