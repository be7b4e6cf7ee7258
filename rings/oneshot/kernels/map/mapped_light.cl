#include "common.clh"
#include "reflectance_map.clh"

// The light of a film by equation M1, of LANES pixels of a row.
LANED __kernel void mapped_light(
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global float *restrict out,
    const int H, const int W, const int K)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, y = line - k * H, size = H * W, at = y * W + x;
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats z = load_floats(height + at, count);
    store_floats(mapped_light_at(reflectance, k, y, x, H, W, p, q, z), out + k * size + at, count);
}
