#include "common.clh"
#include "border.clh"

// The median of size x size pixels; the border is repeated.  `size` is the number of the choice.
__kernel void median_blur(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int size)
{
    GRID_3(k, y, x, K, H, W)
    __global const float *plane = light + k * H * W;
    const int radius = size + 1, count = (2 * radius + 1) * (2 * radius + 1);
    float window[25];
    int n = 0;
    for (int j = -radius; j <= radius; ++j) {
        __global const float *row = plane + within_border(y + j, H, REPLICATE) * W;
        for (int i = -radius; i <= radius; ++i)
            window[n++] = row[within_border(x + i, W, REPLICATE)];
    }
    // Sorted as far as the middle.
    for (int i = 0; i <= count / 2; ++i)
        for (int j = i + 1; j < count; ++j) {
            const float low = fmin(window[i], window[j]);
            window[j] = fmax(window[i], window[j]);
            window[i] = low;
        }
    out[(k * H + y) * W + x] = window[count / 2];
}
