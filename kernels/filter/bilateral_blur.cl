#include "common.clh"
#include "border.clh"

// The mean over a disk, weighted by how near a pixel lies and how alike its light is.
__kernel void bilateral_blur(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const float sigma_light,
    const float sigma_px,
    const int border)
{
    GRID_3(k, y, x, K, H, W)
    __global const float *plane = light + k * H * W;
    const float here = plane[y * W + x];
    const float of_light = -0.5f / (sigma_light * sigma_light);
    const float of_place = -0.5f / (sigma_px * sigma_px);
    float total = 0.0f, weights = 0.0f;
    for (int j = -radius; j <= radius; ++j) {
        __global const float *row = plane + within_border(y + j, H, border) * W;
        for (int i = -radius; i <= radius; ++i) {
            const int square = i * i + j * j;
            if (square > radius * radius) continue;
            const float value = row[within_border(x + i, W, border)], step = value - here;
            const float weight = exp(of_place * (float)square + of_light * step * step);
            total += weight * value;
            weights += weight;
        }
    }
    out[(k * H + y) * W + x] = total / weights;
}
