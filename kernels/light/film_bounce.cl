#include "common.clh"
#pragma OPENCL FP_CONTRACT ON
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "between_cells.clh"
#include "radiosity.clh"
#include "film.clh"
#include "coated_bounce.clh"
#include "sweep.clh"

// Cells at the edge of the rim that only lanes without a share of light read.
#define MARGIN_CELLS 7

// The cells of the frame and of the rim around it: `height` is the one that a pinhole at 1 /
// `pupil` sees, `slope` is the film's. Under a coat also the light they send (`sources`).
LANED __kernel void lay_out(
    __global const float *restrict light,
    __global const float *restrict height,
    __global const float *slope,
    __global const float *restrict lights,
    const float pixel,
    __global float *restrict table,
    const int H, const int W,
    const int factor,
    const int h, const int w, const int rim,
    const float pupil,
    __global float *sources,
    __global const float *restrict diffuse, __global const float *let_in_curve,
    const float base, const float roughness, const float refraction, const float camera)
{
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    GRID_PARTS_OF_ROWS(row, column, count, h + 2 * rim, columns)
    const Side down = side(row, H, h, rim, factor, pixel);
    __global float *cell = table + row * columns + column;
    __global float *sent = sources + row * columns + column;
    const floats j = (float)column + LANE_NUMBERS, none = 0.0f;
    // No step ends beyond these cells, but a sweep may read them.
    if (row < MARGIN_CELLS || row >= h + 2 * rim - MARGIN_CELLS ||
        column + LANES <= MARGIN_CELLS || column >= columns - MARGIN_CELLS) {
        for (int k = 0; k < CELL_ROWS; ++k) store_floats(none, cell + k * N, count);
        for (int k = 0; COATED && k < SOURCE_ROWS; ++k) store_floats(none, sent + k * N, count);
        return;
    }
    const floats u = middles(j, W, rim, factor, pixel);
    const floats v = middles((float)row + none, H, rim, factor, pixel);
    float heights[LANES], rises[LANES], falls[LANES], lit[LANES];
    means_of(height, column, down, W, w, rim, factor, 0.0f, heights);
    for (int l = 0; l < LANES; ++l) {
        const Side across = side(column + l, W, w, rim, factor, pixel);
        const int partial = across.aside > 0.0f || down.aside > 0.0f;
        const int inside = across.pixels > 0 && down.pixels > 0 && (!slope || partial);
        rises[l] = inside ? mean_slope(height, across, down, W, 1, W) / pixel : 0.0f;
        falls[l] = inside ? mean_slope(height, down, across, H, W, 1) / pixel : 0.0f;
        heights[l] += across.aside * rises[l] + down.aside * falls[l];
    }
    const floats apparent = LOAD_LANES(heights);
    floats p = LOAD_LANES(rises), q = LOAD_LANES(falls);
    if (slope) {
        means_of(slope, column, down, W, w, rim, factor, 0.0f, rises);
        means_of(slope + H * W, column, down, W, w, rim, factor, 0.0f, falls);
        p = LOAD_LANES(rises);
        q = LOAD_LANES(falls);
    } else {
        const floats least = MIN_VIEW_SHARE, steep = 1.0f + pupil * (apparent - (p * u + q * v));
        const floats scale = MORE_OF(steep, least);
        p /= scale;
        q /= scale;
    }
    const floats nearer = 1.0f / (1.0f + pupil * apparent), upright = 1.0f / sqrt(1.0f + p * p + q * q);
    const Film film = COATED_FILM;
    store_floats(u * nearer, cell + CELL_X * N, count);
    store_floats(v * nearer, cell + (CELL_X + 1) * N, count);
    store_floats(apparent * nearer, cell + (CELL_X + 2) * N, count);
    store_floats(-p * upright, cell + CELL_NORMAL * N, count);
    store_floats(-q * upright, cell + (CELL_NORMAL + 1) * N, count);
    store_floats(upright, cell + (CELL_NORMAL + 2) * N, count);
    store_floats(apparent, cell + CELL_APPARENT * N, count);
    for (int k = 0; k < LEDS; ++k) {
        __global const float *led = lights + 3 * k;
        const floats dx = led[0] - u, dy = led[1] - v;
        const floats share = led[2] * led[2] / (dx * dx + dy * dy + led[2] * led[2]);
        floats rest = share * sqrt(share);
        if (COATED) rest *= reflectance_at_rest(&film, k, u, v);
        means_of(light + k * H * W, column, down, W, w, rim, factor, 1.0f, lit);
        store_floats(rest * LOAD_LANES(lit), cell + (CELL_LIGHT + k) * N, count);
        store_floats(rest, cell + (CELL_REST + k) * N, count);
    }
    if (COATED) emit(&film, cell, sent, N, count);
}

// The light of cells interpolated at pixels, and relaxed from the previous result by `share`; without
// cells, that result.
LANED __kernel void interpolate(
    __global const float *restrict bounced,
    __global const float *restrict before,
    __global float *restrict out,
    const int H, const int W,
    const int factor,
    const int h, const int w,
    const float share)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    floats results[LEDS] = {0.0f};
    if (bounced) between_cells(bounced, y, x, count, factor, h, w, LEDS, results);
    for (int k = 0; k < LEDS; ++k) {
        const int i = (k * H + y) * W + x;
        const floats earlier = before ? load_floats(before + i, count) : results[k];
        store_floats(before ? earlier + share * (results[k] - earlier) : results[k], out + i, count);
    }
}
