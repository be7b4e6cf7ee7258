#include "common.clh"
#include "lanes.clh"

// Label the darkest LED where the null vector's product with the light departs from zero.
LANED __kernel void shadow_linear(
    __global const float *restrict light,
    __global const float *restrict null,
    const float spread,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const float threshold)
{
    GRID_LANES(i, count, H * W)
    floats departure = 0.0f, least = INFINITY;
    ints darkest = 1;
    for (int k = 0; k < K; ++k) {
        const floats value = load_floats(light + k * H * W + i, count);
        departure += null[k] * value;
        darkest = value < least ? (ints)(1 << k) : darkest;
        least = LESS_OF(value, least);
    }
    const ints shadowed = fabs(departure) > (floats)(threshold * spread);
    store_bytes(shadowed ? darkest : (ints)(0), out + i, count);
}
