#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// The mean over a disk, weighted by a pixel's distance and by the difference of its light.
LANED __kernel void bilateral_blur(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius,
    const float sigma_light,
    const float sigma_px,
    const int border)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, y = line - k * H;
    __global const float *plane = light + k * H * W;
    const floats here = load_floats(plane + y * W + x, count);
    const float of_light = -0.5f / (sigma_light * sigma_light);
    const float of_place = -0.5f / (sigma_px * sigma_px);
    floats total = 0.0f, weights = 0.0f;
    for (int j = -radius; j <= radius; ++j) {
        __global const float *row = plane + within_border(y + j, H, border) * W;
        for (int i = -radius; i <= radius; ++i) {
            const int square = i * i + j * j;
            if (square > radius * radius) continue;
            const floats value = load_within_border(row, x + i, count, W, border);
            const floats step = value - here;
            const floats weight = exp(of_place * (float)square + of_light * step * step);
            total += weight * value;
            weights += weight;
        }
    }
    store_floats(total / weights, out + line * W + x, count);
}
