#include "common.clh"

// The light of the brightest LED that leaves the next pixel away from it dark; else 0.
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
        const float dx = lights[3 * k] / pixel - ((float)x - 0.5f * (W - 1));
        const float dy = lights[3 * k + 1] / pixel - ((float)y - 0.5f * (H - 1));
        const float plan = sqrt(dx * dx + dy * dy) + 1e-6f;
        const int column = (int)rint((float)x - dx / plan), row = (int)rint((float)y - dy / plan);
        if (column < 0 || column >= W || row < 0 || row >= H) continue;
        if (shadow[row * W + column] >> k & 1)
            brightest = fmax(brightest, light[k * H * W + i]);
    }
    return brightest;
}

// Whether any LED is dark within two pixels: only there can be a cliff beside this one.
static int is_near_shadow(
    __global const uchar *shadow, const int H, const int W, const int y, const int x)
{
    uchar labels = 0;
    for (int row = max(y - 2, 0); row <= min(y + 2, H - 1); ++row)
        for (int column = max(x - 2, 0); column <= min(x + 2, W - 1); ++column)
            labels |= shadow[row * W + column];
    return labels != 0;
}

// Add the square of a possible step: the largest cliff of 3 x 3 pixels.
__kernel void cliff_variance(
    __global const float *restrict variance,
    __global const float *restrict light,
    __global const uchar *restrict shadow,
    __global const float *restrict lights,
    const float pixel,
    __global float *restrict out,
    const int H, const int W, const int K,
    const float jump, const float grazing)
{
    GRID_2(y, x, H, W)
    float largest = 0.0f;
    const int reach = is_near_shadow(shadow, H, W, y, x) ? 1 : -1;
    for (int row = max(y - reach, 0); row <= min(y + reach, H - 1); ++row)
        for (int column = max(x - reach, 0); column <= min(x + reach, W - 1); ++column)
            largest = fmax(largest,
                           cliff(light, shadow, lights, pixel, K, H, W, row, column));
    const float step = jump * fmax(largest - grazing, 0.0f);
    const int size = H * W, i = y * W + x;
    out[i] = variance[i] + step * step;
    out[size + i] = variance[size + i] + step * step;
}
