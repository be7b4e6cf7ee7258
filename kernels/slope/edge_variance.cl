// Equation W3 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// `count` normals of a row of slopes, W in all, from x on.
static void normals(
    __global const float *row, const int size, const int x, const int count, const int W,
    floats *n)
{
    const floats p = load_within_border(row, x, count, W, REPLICATE);
    const floats q = load_within_border(row + size, x, count, W, REPLICATE);
    const floats nz = 1.0f / sqrt(1.0f + p * p + q * q);
    n[0] = -p * nz;
    n[1] = -q * nz;
    n[2] = nz;
}

// |n'_z| |n'| of a change between neighbours two pixels apart.
static floats turn(const floats *before, const floats *after)
{
    const floats x = after[0] - before[0], y = after[1] - before[1], z = after[2] - before[2];
    return 0.25f * fabs(z) * sqrt(x * x + y * y + z * z);
}

LANED __kernel void find_changes(
    __global const float *restrict slope,
    __global float *restrict changes,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    __global const float *row = slope + y * W;
    floats before[3], after[3];
    normals(row, H * W, x - 1, count, W, before);
    normals(row, H * W, x + 1, count, W, after);
    const floats along = turn(before, after);
    normals(slope + max(y - 1, 0) * W, H * W, x, count, W, before);
    normals(slope + min(y + 1, H - 1) * W, H * W, x, count, W, after);
    store_floats(along + turn(before, after), changes + y * W + x, count);
}

// Add the square of what the slope may lack, by the largest change of 3 x 3 pixels.
LANED __kernel void add_lacking(
    __global const float *restrict variance,
    __global const float *restrict slope,
    __global const float *restrict changes,
    __global float *restrict out,
    const int H, const int W,
    const float by)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    floats largest = 0.0f;
    for (int dy = -1; dy <= 1; ++dy) {
        __global const float *row = changes + clamp(y + dy, 0, H - 1) * W;
        for (int dx = -1; dx <= 1; ++dx) {
            const floats there = load_within_border(row, x + dx, count, W, REPLICATE);
            largest = MORE_OF(largest, there);
        }
    }
    const int size = H * W, i = y * W + x;
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats lacking = by * largest * (1.0f + p * p + q * q);
    const floats more = lacking * lacking;
    store_floats(load_floats(variance + i, count) + more, out + i, count);
    store_floats(load_floats(variance + size + i, count) + more, out + size + i, count);
}
