#include "common.clh"
#include "reflectance_map.clh"

// The light of a film by equation M1.
__kernel void mapped_light(
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global float *restrict out,
    const int H, const int W, const int K)
{
    GRID_3(k, y, x, K, H, W)
    const int at = y * W + x;
    out[k * H * W + at] =
        mapped_light_at(reflectance, k, y, x, H, W, slope[at], slope[H * W + at], height[at]);
}
