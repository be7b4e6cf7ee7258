#include "common.clh"
#include "reflectance_map.clh"

#define MIN_MAP_ERROR 0.007f
#define MIN_LIGHT 1e-3f

// The reduced chi-squared of a pixel's light under its slope, equation T1 for a map, and the excess
// of its brightness, T4.
LANED __kernel void map_departure(
    __global const float *restrict light,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global const float *restrict misfit,
    __global float *restrict departure,
    __global float *restrict brighter,
    const int K, const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, at = row * W + column;
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats z = load_floats(height + at, count), least = MIN_LIGHT;
    floats chi = 0.0f, measured = 0.0f, due = 0.0f;
    for (int k = 0; k < K; ++k) {
        const floats result = load_floats(light + k * size + at, count);
        const floats shown = mapped_light_at(reflectance, k, row, column, H, W, p, q, z);
        const floats residual = result - shown;
        chi += residual * residual;
        measured += result * shown;
        due += shown * shown;
    }
    const float error = max(misfit[2], MIN_MAP_ERROR);
    store_floats(chi / (error * error * (float)(K - 2)), departure + at, count);
    store_floats(measured / MORE_OF(due, least) - 1.0f, brighter + at, count);
}
