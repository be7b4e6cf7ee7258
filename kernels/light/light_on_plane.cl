// Equation F5 of docs/model.md.
#include "common.clh"
#include "lanes.clh"

// Light relative to a plane, from light relative to the film at rest.
LANED __kernel void light_on_plane(
    __global const float *restrict light,
    __global const float *restrict share,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int inverse)
{
    GRID_LANES(i, count, K * H * W)
    floats shown = load_floats(light + i, count);
    if (share) {
        const floats at_rest = load_floats(share + i, count);
        shown = inverse ? shown / at_rest : shown * at_rest;
    }
    store_floats(shown, out + i, count);
}
