#include "common.clh"

// Divergence of the slopes half-way between neighbours; none across the border.
__kernel void divergence(
    __global const float *restrict slope,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    __global const float *p = slope, *q = slope + H * W;
    const float right = x + 1 < W ? (p[i] + p[i + 1]) * 0.5f : 0.0f;
    const float left = x > 0 ? (p[i - 1] + p[i]) * 0.5f : 0.0f;
    const float below = y + 1 < H ? (q[i] + q[i + W]) * 0.5f : 0.0f;
    const float above = y > 0 ? (q[i - W] + q[i]) * 0.5f : 0.0f;
    out[i] = (right - left) + (below - above);
}

// The Poisson equation in the cosine domain, and from pixels to mm.
__kernel void divide(
    __global float *restrict spectrum,
    __global const float *restrict inverse,
    const int H, const int W,
    const float pixel)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    spectrum[i] = spectrum[i] * inverse[i] * pixel;
}
