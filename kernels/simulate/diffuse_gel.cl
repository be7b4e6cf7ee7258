#include "common.clh"
#include "lanes.clh"

// A share of the light comes from all sides.
LANED __kernel void diffuse_gel(
    __global const float *restrict light,
    __global const float *restrict rest,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float share)
{
    GRID_LANES(i, count, K * H * W)
    const floats direct = load_floats(light + i, count), even = load_floats(rest + i, count);
    store_floats((1.0f - share) * direct + share * even, out + i, count);
}
