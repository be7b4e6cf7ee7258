#include "common.clh"
#include "lanes.clh"

// The sum of two lights.
LANED __kernel void add_light(
    __global const float *restrict light,
    __global const float *restrict more,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_LANES(i, count, K * H * W)
    floats sum = load_floats(light + i, count);
    if (more) sum += load_floats(more + i, count);
    store_floats(sum, out + i, count);
}
