#include "common.clh"

#define SHADE_COUNT 9
#define PLACE_TERMS 15
#define PLACE_DEGREE 4
#define MIN_MAP_ERROR 0.007f

// A coefficient at the place (u, v): the monomials of degree d are u^d, u^(d-1) v, ..., v^d.
static float at_place(__global const float *map, const float u, const float v)
{
    float sum = map[0];
    float of_degree[PLACE_DEGREE + 1] = {1.0f};
    for (int degree = 1, term = 1; degree <= PLACE_DEGREE; ++degree) {
        of_degree[degree] = of_degree[degree - 1] * v;
        for (int i = degree - 1; i >= 0; --i) of_degree[i] *= u;
        for (int i = 0; i <= degree; ++i, ++term) sum += map[term] * of_degree[i];
    }
    return sum;
}

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
    const float scale = 2.0f / (float)W;
    const float u = ((float)column - 0.5f * (float)(W - 1)) * scale;
    const float v = ((float)row - 0.5f * (float)(H - 1)) * scale;
    const float p = slope[at], q = slope[size + at];
    const float z = 1.0f / sqrt(1.0f + p * p + q * q), x = -p * z, y = -q * z;
    float chi = 0.0f;
    for (int k = 0; k < K; ++k) {
        float c[SHADE_COUNT];
        for (int b = 0; b < SHADE_COUNT; ++b)
            c[b] = at_place(reflectance + (k * SHADE_COUNT + b) * PLACE_TERMS, u, v);
        const float shown = c[0] * x + c[1] * y + c[2] * (z - 1.0f) + c[3] * (x * y) +
                            c[4] * (x * z) + c[5] * (y * z) + c[6] * (x * x - y * y) +
                            c[7] * (3.0f * (z * z - 1.0f)) + c[SHADE_COUNT - 1] * height[at];
        const float left = light[k * size + at] - 1.0f - shown;
        chi += left * left;
    }
    const float error = max(misfit[2], MIN_MAP_ERROR);
    out[at] = chi / (error * error * (float)(K - 2));
}
