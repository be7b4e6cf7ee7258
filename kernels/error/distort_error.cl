#include "common.clh"
#include "lanes.clh"
#include "lens.clh"

static floats value_of(
    __global const float *restrict plane, const ints row, const ints column, const int W)
{
    int at[LANES];
    STORE_LANES(row * W + column, at);
    return gather_floats(plane, at);
}

// The height's standard deviation at each pixel of the camera, by linear interpolation.
LANED __kernel void distort_error(
    __global const float *restrict error,
    __global const float *restrict lens,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column;
    if (!is_bent(lens)) {
        store_floats(load_floats(error + at, count), out + at, count);
        return;
    }
    const floats none = 0.0f, right = (float)(W - 1), bottom = (float)(H - 1);
    floats u, v;
    ideal_places(lens, row, column, H, W, &u, &v);
    u = LESS_OF(MORE_OF(u, none), right);
    v = LESS_OF(MORE_OF(v, none), bottom);
    const floats across = u - floor(u), down = v - floor(v);
    const ints west = TO_INTS(u), north = TO_INTS(v), last_row = H - 1, last_column = W - 1;
    const ints east = LESS_OF(west + 1, last_column), south = LESS_OF(north + 1, last_row);
    const floats upper = (1.0f - across) * value_of(error, north, west, W)
        + across * value_of(error, north, east, W);
    const floats lower = (1.0f - across) * value_of(error, south, west, W)
        + across * value_of(error, south, east, W);
    store_floats((1.0f - down) * upper + down * lower, out + at, count);
}
