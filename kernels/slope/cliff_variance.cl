// Equation W2 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "label_edges.clh"
#include "rays.clh"

// The light of the brightest LED for which the next pixel away from it is dark; else 0.
static float cliff(
    __global const float *light,
    __global const uchar *shadow,
    __global const float *lights,
    const float pixel,
    const int K, const int H, const int W, const int y, const int x)
{
    const int i = y * W + x;
    float brightest = 0.0f;
    for (int k = 0; k < K; ++k) {
        if (shadow[i] >> k & 1) continue;
        const Ray ray = ray_towards(lights + 3 * k, y, x, H, W, pixel);
        const int next = nearest(point_at(ray, -1.0f), H, W);
        if (next != NO_PIXEL && shadow[next] >> k & 1)
            brightest = fmax(brightest, light[k * H * W + i]);
    }
    return brightest;
}

// Cliffs occur only where a label varies.
LANED __kernel void find_cliffs(
    __global const float *restrict light, __global const uchar *restrict shadow,
    __global const float *restrict lights, __global float *restrict cliffs, const int K,
    const int H, const int W, const float pixel)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int near = ANY(edges(shadow, y, x, count, H, W, 1) != 0);
    for (int l = 0; l < count; ++l)
        cliffs[y * W + x + l] =
            near ? cliff(light, shadow, lights, pixel, K, H, W, y, x + l) : 0.0f;
}

// Add the square of a possible step: the largest cliff of 3 x 3 pixels.
LANED __kernel void add_steps(
    __global const float *restrict variance, __global const float *restrict cliffs,
    __global float *restrict out, const int H, const int W, const float jump, const float grazing)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const floats least = grazing, result = largest_around(cliffs, y, x, count, H, W);
    const floats largest = MORE_OF(result, least);
    const floats step = jump * (largest - grazing);
    const int size = H * W, i = y * W + x;
    store_floats(load_floats(variance + i, count) + step * step, out + i, count);
    store_floats(load_floats(variance + size + i, count) + step * step, out + size + i, count);
}
