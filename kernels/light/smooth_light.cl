#include "common.clh"

// Binomial mean over 5 x 5 pixels; the border is repeated.
__kernel void smooth_light(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    const float taps[5] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
    GRID_3(k, y, x, K, H, W)
    __global const float *plane = light + k * H * W;
    float total = 0.0f;
    for (int j = 0; j < 5; ++j) {
        __global const float *row = plane + clamp(y + j - 2, 0, H - 1) * W;
        float along = 0.0f;
        for (int i = 0; i < 5; ++i)
            along += taps[i] * row[clamp(x + i - 2, 0, W - 1)];
        total += taps[j] * along;
    }
    out[(k * H + y) * W + x] = total;
}
