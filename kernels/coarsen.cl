#include "common.clh"

// The mean of every cell of factor x factor pixels; beyond the border its pixels count again.
__kernel void coarsen(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int factor)
{
    GRID_3(k, row, column, K, h, w)
    __global const float *plane = light + k * H * W;
    float total = 0.0f;
    for (int i = 0; i < factor; ++i) {
        const int x = min(column * factor + i, W - 1);
        float sum = 0.0f;
        for (int j = 0; j < factor; ++j)
            sum += plane[min(row * factor + j, H - 1) * W + x];
        total += sum;
    }
    out[(k * h + row) * w + column] = total * (1.0f / (float)(factor * factor));
}
