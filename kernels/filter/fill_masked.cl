#include "common.clh"

// The light where the mask is set, else the weighted mean of what is known around.
__kernel void fill_masked(
    __global const float *restrict light,
    __global const uchar *restrict mask,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius, const float least)
{
    GRID_3(k, y, x, K, H, W)
    const int pixel = y * W + x;
    __global const float *plane = light + k * H * W;
    float value = plane[pixel];
    if (!mask[pixel]) {
        float sum = 0.0f, total = 0.0f;
        for (int j = max(y - radius, 0); j <= min(y + radius, H - 1); ++j) {
            float row_sum = 0.0f, row_total = 0.0f;
            for (int i = max(x - radius, 0); i <= min(x + radius, W - 1); ++i)
                if (mask[j * W + i]) {
                    row_sum += taps[i - x + radius] * plane[j * W + i];
                    row_total += taps[i - x + radius];
                }
            sum += taps[j - y + radius] * row_sum;
            total += taps[j - y + radius] * row_total;
        }
        if (total > least) value = sum / total;
    }
    out[k * H * W + pixel] = value;
}
