#include "common.clh"

// Light relative to the film at rest, per LED: (image - dark) / flat.
__kernel void flat_field(
    __global const float *restrict image,
    __global const float *restrict flat,
    __global const float *restrict dark,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float floor_)
{
    GRID_3(k, y, x, K, H, W)
    const int pixel = y * W + x;
    const int i = k * H * W + pixel;
    out[i] = (image[i] - dark[pixel]) / fmax(flat[i], floor_);
}
