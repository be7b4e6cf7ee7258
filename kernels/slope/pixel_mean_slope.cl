#include "common.clh"
#include "lanes.clh"

#define PIXEL_VARIANCE (1.0f / 12.0f)

typedef struct {
    floats x, y, z;
} Vector;

static Vector normals_of(const floats p, const floats q)
{
    const floats nz = 1.0f / sqrt(1.0f + p * p + q * q);
    const Vector n = {-p * nz, -q * nz, nz};
    return n;
}

// The normals of pixels that follow one another.
static Vector normals(
    __global const float *slope, const int size, const int at, const int count)
{
    return normals_of(load_floats(slope + at, count), load_floats(slope + size + at, count));
}

// The normals at pixels that lie anywhere.
static Vector normals_at(__global const float *slope, const int size, const int *at)
{
    return normals_of(gather_floats(slope, at), gather_floats(slope + size, at));
}

static Vector difference(const Vector a, const Vector b, const floats share)
{
    const Vector d = {(a.x - b.x) * share, (a.y - b.y) * share, (a.z - b.z) * share};
    return d;
}

static floats within(const floats value, const floats limit)
{
    const floats low = MORE_OF(value, -limit);
    return LESS_OF(low, limit);
}

// Slopes corrected for the change of the normal within a pixel, equation V4.
LANED __kernel void pixel_mean_slope(
    __global const float *restrict slope,
    __global float *restrict out,
    const int H, const int W,
    const float most)
{
    GRID_LANES(at, count, H * W)
    const int size = H * W, row = at / W, column = at - row * W;
    Vector along, down;
    if (column > 0 && column + LANES < W) {
        const floats half_ = 0.5f, share = row > 0 && row + 1 < H ? 0.5f : 1.0f;
        const int above = row > 0 ? at - W : at, below = row + 1 < H ? at + W : at;
        along = difference(
            normals(slope, size, at + 1, count), normals(slope, size, at - 1, count), half_);
        down = difference(
            normals(slope, size, below, count), normals(slope, size, above, count), share);
    } else {
        int left[LANES], right[LANES], above[LANES], below[LANES];
        float across[LANES], upright[LANES];
        for (int l = 0; l < LANES; ++l) {
            const int i = min(at + l, size - 1), y = i / W, x = i - y * W;
            left[l] = x > 0 ? i - 1 : i;
            right[l] = x + 1 < W ? i + 1 : i;
            above[l] = y > 0 ? i - W : i;
            below[l] = y + 1 < H ? i + W : i;
            across[l] = x > 0 && x + 1 < W ? 0.5f : 1.0f;
            upright[l] = y > 0 && y + 1 < H ? 0.5f : 1.0f;
        }
        along = difference(
            normals_at(slope, size, right), normals_at(slope, size, left), LOAD_LANES(across));
        down = difference(
            normals_at(slope, size, below), normals_at(slope, size, above), LOAD_LANES(upright));
    }
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats square = 1.0f + p * p + q * q, limit = most * square, by = square * PIXEL_VARIANCE;
    const floats add_p = down.z * (down.x + p * down.z) + along.z * (along.x + p * along.z);
    const floats add_q = down.z * (down.y + q * down.z) + along.z * (along.y + q * along.z);
    store_floats(p + within(add_p * by, limit), out + at, count);
    store_floats(q + within(add_q * by, limit), out + size + at, count);
}
