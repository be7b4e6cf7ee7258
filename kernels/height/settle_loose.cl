#include "common.clh"

// Loose pixels move by the least of their departures along the four lines through them.
__kernel void settle_loose(
    __global const float *restrict height,
    __global const float *restrict variance,
    __global float *restrict out,
    const int H, const int W,
    const float loose)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    const int left = max(x - 1, 0), right = min(x + 1, W - 1);
    const int above = max(y - 1, 0) * W, here = y * W, below = min(y + 1, H - 1) * W;
    const float z = height[i];
    const float a = z - 0.5f * (height[here + right] + height[here + left]);
    const float b = z - 0.5f * (height[below + x] + height[above + x]);
    const float c = z - 0.5f * (height[below + right] + height[above + left]);
    const float d = z - 0.5f * (height[below + left] + height[above + right]);
    const float least = fmax(fmin(fmin(a, b), fmin(c, d)), 0.0f)
        + fmin(fmax(fmax(a, b), fmax(c, d)), 0.0f);
    out[i] = fmin(variance[i], variance[H * W + i]) > loose ? z - least : z;
}
