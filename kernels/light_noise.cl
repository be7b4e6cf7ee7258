#include "common.clh"

// Standard deviation of the light relative to the film at rest: shot and read noise.
__kernel void light_noise(
    __global const float *restrict image,
    __global const float *restrict flat,
    __global const float *restrict noise,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float floor_)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    const float variance = noise[0] * fmax(image[i], 0.0f) + noise[1];
    out[i] = sqrt(variance) / fmax(flat[i], floor_);
}
