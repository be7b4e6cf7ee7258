// Equation V4 of docs/model.md.
#include "common.clh"
#include "normals.clh"
#include "bend.clh"

#define PIXEL_VARIANCE (1.0f / 12.0f)

// The correction of a slope along one axis: `by` is the change of that component of the normal per
// pixel, and `dz` that of n_z.
static floats added(const floats by, const floats dz, const floats slope)
{
    return dz * (by + slope * dz);
}

// Slopes corrected for the change of the normal within a pixel.
LANED __kernel void pixel_mean_slope(
    __global const float *restrict slope, __global float *restrict out, const int H, const int W,
    const float most, const int inverse)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int size = H * W, at = y * W + x;
    const Changes n = changes_at(slope, y, x, count, H, W);
    const floats column = (float)x + LANE_NUMBERS, half_ = 0.5f, one = 1.0f;
    const floats across = (column > 0.0f & column < (float)(W - 1)) ? half_ : one;
    const float upright = y > 0 && y + 1 < H ? 0.5f : 1.0f;
    const floats right = n.along.z * across, lower = n.down.z * upright;
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats square = 1.0f + p * p + q * q, limit = most * square, by = square * PIXEL_VARIANCE;
    floats add_p =
        by * (added(n.down.x * upright, lower, p) + added(n.along.x * across, right, p));
    floats add_q =
        by * (added(n.down.y * upright, lower, q) + added(n.along.y * across, right, q));
    if (inverse) {
        // What a pixel's mean slopes exceed differences over two pixels by.
        const Bend of_p = bend_at(slope, y, x, count, H, W);
        const Bend of_q = bend_at(slope + size, y, x, count, H, W);
        add_p = (PIXEL_VARIANCE / 2.0f) * (of_p.along - 3.0f * of_p.across) - add_p;
        add_q = (PIXEL_VARIANCE / 2.0f) * (of_q.across - 3.0f * of_q.along) - add_q;
    }
    store_floats(p + clipped(add_p, limit), out + at, count);
    store_floats(q + clipped(add_q, limit), out + size + at, count);
}
