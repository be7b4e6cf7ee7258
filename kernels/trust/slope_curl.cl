#include "common.clh"
#include "border.clh"
#include "pixels.clh"
#include "cells.clh"
#include "cell_side.clh"

#define MIN_LEDS 3
#define FULL_MISFIT_SLOPE 0.1f
#define NOT_TESTED (-1.0f)

// The means of LANES cells of side x side pixels.
static floats means_of(
    __global const float *plane, const int row, const int column, const int count, const int H,
    const int W, const int side)
{
    if (side > 1) return mean_of_cells(plane, row, column, H, W, side);
    return load_within_border(plane + row * W, column, count, W, REPLICATE);
}

// The LEDs used for the slopes of the first pixels of these cells.
static ints leds_of(
    __global const uchar *used, const int row, const int column, const int count, const int W,
    const int side)
{
    __global const uchar *line = used + row * side * W;
    if (side == 1) return load_bytes_within_border(line, column, count, W, REPLICATE);
    uchar values[LANES];
    for (int l = 0; l < LANES; ++l) values[l] = line[min((column + l) * side, W - 1)];
    return TO_INTS(LOAD_LANES(values));
}

// The curl between LANES cells, those right of them and below, over its standard deviation,
// equation T2.
LANED __kernel void slope_curl(
    __global const float *restrict slope,
    __global const float *restrict misfit,
    __global const uchar *restrict used,
    __global const float *restrict variance,
    __global float *restrict out,
    const int H, const int W,
    const int h, const int w,
    const int factor,
    const int cell_px,
    const float share,
    const float least)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const int size = H * W, side = cell_side(H, W, factor);
    const floats untested = NOT_TESTED;
    if (row == h - 1) {
        store_floats(untested, out + row * w + column, count);
        return;
    }
    floats p[4], q[4], gentlest = INFINITY, noise = 0.0f;
    ints tests = filled(count);
    for (int c = 0; c < 4; ++c) {
        const int y = row + c / 2, x = column + c % 2;
        p[c] = means_of(slope, y, x, count, H, W, side);
        q[c] = means_of(slope + size, y, x, count, H, W, side);
        const floats steepness = p[c] * p[c] + q[c] * q[c];
        gentlest = LESS_OF(gentlest, steepness);
        if (used) tests &= has_bits(leds_of(used, y, x, count, W, side), MIN_LEDS);
        if (variance)
            noise += means_of(variance, y, x, count, H, W, side)
                + means_of(variance + size, y, x, count, H, W, side);
    }
    const floats p_right = (p[1] - p[0] + (p[3] - p[2])) * 0.5f;
    const floats p_down = (p[2] - p[0] + (p[3] - p[1])) * 0.5f;
    const floats q_right = (q[1] - q[0] + (q[3] - q[2])) * 0.5f;
    const floats q_down = (q[2] - q[0] + (q[3] - q[1])) * 0.5f;
    const floats bent =
        p_right * p_right + p_down * p_down + q_right * q_right + q_down * q_down;
    const floats number = (float)column + LANE_NUMBERS, last = (float)(w - 1);
    tests &= gentlest > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE;
    tests &= number < last;
    const float pixels = (float)(side * cell_px) * (float)(side * cell_px);
    const floats curl = p_down - q_right;
    const floats expected = least * least + misfit[0] * misfit[0] + share * share * bent
        + noise * 0.25f / pixels;
    store_floats(tests ? curl * curl / expected : untested, out + row * w + column, count);
}
