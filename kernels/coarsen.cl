#include "common.clh"

// The mean, or the first, of every cell of factor x factor pixels; beyond the border its pixels
// count again.
__kernel void coarsen(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int factor,
    const int take)
{
    GRID_3(k, row, column, K, h, w)
    __global const float *plane = light + k * H * W;
    const int x = column * factor, cell = (k * h + row) * w + column;
    if (take) {
        out[cell] = plane[row * factor * W + x];
        return;
    }
    float total = 0.0f;
    if (factor % 4 == 0 && x + factor <= W) {
        // Four columns at a time, in the same order.
        for (int i = 0; i < factor; i += 4) {
            float4 sum = 0.0f;
            for (int j = 0; j < factor; ++j)
                sum += vload4(0, plane + min(row * factor + j, H - 1) * W + x + i);
            total = total + sum.x + sum.y + sum.z + sum.w;
        }
    } else {
        for (int i = 0; i < factor; ++i) {
            float sum = 0.0f;
            for (int j = 0; j < factor; ++j)
                sum += plane[min(row * factor + j, H - 1) * W + min(x + i, W - 1)];
            total += sum;
        }
    }
    out[cell] = total * (1.0f / (float)(factor * factor));
}
