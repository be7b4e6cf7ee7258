#include "common.clh"
#include "lanes.clh"
#include "lens.clh"

// The values of LANES pixels, or of those `right` columns and `below` rows further.
static floats gathered(
    __global const float *restrict plane, const int *left, const int *top,
    const int right, const int below, const int H, const int W)
{
    float found[LANES];
    for (int l = 0; l < LANES; ++l)
        found[l] = plane[min(top[l] + below, H - 1) * W + min(left[l] + right, W - 1)];
    return LOAD_LANES(found);
}

// The height's standard deviation at each pixel of the camera, by linear interpolation.
LANED __kernel void error_as_seen(
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
    int left[LANES], top[LANES];
    STORE_LANES(TO_INTS(u), left);
    STORE_LANES(TO_INTS(v), top);
    const floats upper = (1.0f - across) * gathered(error, left, top, 0, 0, H, W)
        + across * gathered(error, left, top, 1, 0, H, W);
    const floats lower = (1.0f - across) * gathered(error, left, top, 0, 1, H, W)
        + across * gathered(error, left, top, 1, 1, H, W);
    store_floats((1.0f - down) * upper + down * lower, out + at, count);
}
