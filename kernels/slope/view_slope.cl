#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MIN_VIEW_SHARE 0.1f

// Slopes in the camera's view, or of the film, equation V2.
LANED __kernel void view_slope(
    __global const float *restrict slope, __global const float *restrict height, const float camera,
    const float pixel, __global float *restrict out, const int H, const int W, const int inverse)
{
    GRID_LANES(at, count, H * W)
    floats p = load_floats(slope + at, count), q = load_floats(slope + H * W + at, count);
    if (camera != 0.0f) {
        floats u, v;
        places(at, H, W, pixel, &u, &v);
        const floats apparent = load_floats(height + at, count), least = MIN_VIEW_SHARE;
        const floats along = p * u + q * v, z = apparent / (1.0f + camera * apparent);
        const floats nearer = 1.0f - camera * z;
        const floats share = inverse ? 1.0f + camera * (apparent - along)
                                     : 1.0f - camera * (z - along * nearer);
        const floats by = 1.0f / MORE_OF(share, least);
        p *= by;
        q *= by;
        // Film that faces the camera by less is not visible.
        const floats square = p * p + q * q, most = 1.0f / (MIN_VIEW_SHARE * MIN_VIEW_SHARE) - 1.0f;
        const floats less = inverse ? square : LESS_OF(square, most);
        const floats shorter = sqrt(less / square);
        p = less < square ? p * shorter : p;
        q = less < square ? q * shorter : q;
    }
    store_floats(p, out + at, count);
    store_floats(q, out + H * W + at, count);
}
