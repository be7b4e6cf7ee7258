// Equation W3 of docs/model.md.
#include "common.clh"
#include "normals.clh"

// |n'_z| |n'| of a change between neighbours two pixels apart.
static floats turn(const Vector change)
{
    const floats x = change.x, y = change.y, z = change.z;
    return 0.25f * fabs(z) * sqrt(x * x + y * y + z * z);
}

LANED __kernel void find_changes(
    __global const float *restrict slope, __global float *restrict changes, const int H,
    const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const Changes n = changes_at(slope, y, x, count, H, W);
    store_floats(turn(n.along) + turn(n.down), changes + y * W + x, count);
}

// Add the square of the slope's possible error, by the largest change of 3 x 3 pixels.
LANED __kernel void add_lacking(
    __global const float *restrict variance, __global const float *restrict slope,
    __global const float *restrict changes, __global float *restrict out, const int H, const int W,
    const float by)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const floats largest = largest_around(changes, y, x, count, H, W);
    const int size = H * W, i = y * W + x;
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats lacking = by * largest * (1.0f + p * p + q * q);
    const floats more = lacking * lacking;
    store_floats(load_floats(variance + i, count) + more, out + i, count);
    store_floats(load_floats(variance + size + i, count) + more, out + size + i, count);
}
