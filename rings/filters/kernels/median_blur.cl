#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// The median, in all lanes, by sorting up to the middle.
static floats middle_of(floats *window, const int count)
{
    for (int i = 0; i <= count / 2; ++i)
        for (int j = i + 1; j < count; ++j) {
            const floats low = LESS_OF(window[i], window[j]);
            window[j] = MORE_OF(window[i], window[j]);
            window[i] = low;
        }
    return window[count / 2];
}

// The median of 3 x 3 pixels (size 0) or 5 x 5 (size 1); the border is repeated.
LANED __kernel void median_blur(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int size)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, y = line - k * H, radius = size + 1;
    __global const float *plane = light + k * H * W;
    floats window[25];
    int n = 0;
    for (int j = -radius; j <= radius; ++j) {
        __global const float *row = plane + within_border(y + j, H, REPLICATE) * W;
        for (int i = -radius; i <= radius; ++i)
            window[n++] = load_within_border(row, x + i, count, W, REPLICATE);
    }
    store_floats(size ? middle_of(window, 25) : middle_of(window, 9), out + line * W + x, count);
}
