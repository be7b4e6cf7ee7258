#include "common.clh"

// Both slopes as one complex field p + i q.
__kernel void pack(
    __global const float *restrict slope,
    __global float2 *restrict both,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    both[i] = (float2)(slope[i], slope[H * W + i]);
}

// Equation 14.  The spectra of p and q are the even and odd parts of that of p + i q.
__kernel void combine(
    __global const float2 *restrict both,
    __global const float *restrict v_of,
    __global const float *restrict u_of,
    __global float2 *restrict spectrum,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    const int xm = x ? W - x : 0, ym = y ? H - y : 0;
    const float2 a = both[i], b = both[ym * W + xm];
    const float2 p = (float2)(a.x + b.x, a.y - b.y) * 0.5f;
    const float2 q = (float2)(a.y + b.y, b.x - a.x) * 0.5f;
    // Only half of the frequencies along x are kept on the host: the others are negative.
    const float u = x <= W / 2 ? u_of[x] : -u_of[W - x];
    const float v = v_of[y];
    const float square = u * u + v * v;
    const float scale = square > 0.0f ? 1.0f / square : 0.0f;
    const float2 sum = (u * p + v * q) * scale;
    spectrum[i] = (float2)(sum.y, -sum.x);
}

__kernel void real_part(
    __global const float2 *restrict spectrum,
    __global float *restrict out,
    const int H, const int W,
    const float pixel)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    out[i] = spectrum[i].x * pixel;
}
