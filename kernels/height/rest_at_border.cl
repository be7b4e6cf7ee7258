#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "ring.clh"

LANED __kernel ONE_GROUP void border_median(
    __global const float *restrict height,
    __global float *restrict values,
    __global float *restrict median,
    const int H, const int W,
    const int border)
{
    SHARED float parts[GROUP];
    const int size = ring_size(H, W, border);
    for (int j = PLACE_IN_GROUP; j < size; j += GROUP)
        values[j] = height[on_ring(j, H, W, border)];
    barrier(CLK_GLOBAL_MEM_FENCE);
    const float result = group_median(values, size, parts);
    if (PLACE_IN_GROUP == 0) median[0] = result;
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
