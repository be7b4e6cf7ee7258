#include "common.clh"
#include "reflectance_map.clh"

#define MIN_MAP_ERROR 0.007f

// The reduced chi-squared of a pixel's light under its slope, equation T1 for a map.
__kernel void map_departure(
    __global const float *restrict light,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global const float *restrict misfit,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_2(row, column, H, W)
    const int size = H * W, at = row * W + column;
    float chi = 0.0f;
    for (int k = 0; k < K; ++k) {
        const float left = light[k * size + at]
            - mapped_light_at(reflectance, k, row, column, H, W, slope[at], slope[size + at], height[at]);
        chi += left * left;
    }
    const float error = max(misfit[2], MIN_MAP_ERROR);
    out[at] = chi / (error * error * (float)(K - 2));
}
