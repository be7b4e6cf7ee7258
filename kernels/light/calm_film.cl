#include "common.clh"

// 1 where the mean light of every LED over a window is 1 within its noise.
__kernel void calm_film(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const int radius_px,
    const float level)
{
    GRID_2(y, x, H, W)
    const int size = H * W, i = y * W + x;
    const float width = (float)(2 * radius_px + 1);
    int calm = 1;
    for (int k = 0; k < K && calm; ++k) {
        __global const float *plane = light + k * size;
        float sum = 0.0f;
        for (int dy = -radius_px; dy <= radius_px; ++dy) {
            const int row = clamp(y + dy, 0, H - 1) * W;
            for (int dx = -radius_px; dx <= radius_px; ++dx)
                sum += plane[row + clamp(x + dx, 0, W - 1)] - 1.0f;
        }
        calm = fabs(sum) / width < level * sigma[k * size + i];
    }
    out[i] = calm;
}
