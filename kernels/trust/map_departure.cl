#include "common.clh"
#include "reflectance_map.clh"

#define MIN_MAP_ERROR 0.007f
#define MIN_SQUARES 1e-6f

// The reduced chi-squared of a pixel's light under its slope, equation T1 for a map, and the excess
// of its brightness, T4.
__kernel void map_departure(
    __global const float *restrict light,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global const float *restrict misfit,
    __global float *restrict departure,
    __global float *restrict brighter,
    const int K, const int H, const int W)
{
    GRID_2(row, column, H, W)
    const int size = H * W, at = row * W + column;
    float chi = 0.0f, seen = 0.0f, due = 0.0f;
    for (int k = 0; k < K; ++k) {
        const float found = light[k * size + at];
        const float shown = mapped_light_at(
            reflectance, k, row, column, H, W, slope[at], slope[size + at], height[at]);
        const float left = found - shown;
        chi += left * left;
        seen += found * shown;
        due += shown * shown;
    }
    const float error = max(misfit[2], MIN_MAP_ERROR);
    departure[at] = chi / (error * error * (float)(K - 2));
    brighter[at] = seen / fmax(due, MIN_SQUARES) - 1.0f;
}
