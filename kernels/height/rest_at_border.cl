#include "common.clh"
#include "lanes.clh"
#include "group.clh"

// The place of the j-th pixel of the border: top, bottom, and both ends of the rows between.
static int on_border(const int j, const int H, const int W, const int border)
{
    const int across = border * W;
    if (H <= 2 * border || W <= 2 * border || j < across) return j;
    if (j < 2 * across) return (H - border) * W + j - across;
    const int end = (j - 2 * across) % (2 * border), row = border + (j - 2 * across) / (2 * border);
    return row * W + (end < border ? end : W - 2 * border + end);
}

LANED __kernel ONE_GROUP void border_median(
    __global const float *restrict height,
    __global float *restrict values,
    __global float *restrict median,
    const int H, const int W,
    const int border)
{
    SHARED float parts[GROUP];
    const int inner = max(H - 2 * border, 0) * max(W - 2 * border, 0), size = H * W - inner;
    for (int j = PLACE_IN_GROUP; j < size; j += GROUP)
        values[j] = height[on_border(j, H, W, border)];
    barrier(CLK_GLOBAL_MEM_FENCE);
    const float found = group_median(values, size, parts);
    if (PLACE_IN_GROUP == 0) median[0] = found;
}

LANED __kernel void subtract(
    __global const float *restrict height,
    __global const float *restrict median,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_LANES(i, count, H * W)
    store_floats(load_floats(height + i, count) - median[0], out + i, count);
}
