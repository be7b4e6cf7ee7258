#include "common.clh"

// Slope and height of a ball inside its contact circle; zero, and masked out, outside.
__kernel void ball_slopes(
    __global const float *restrict light,
    __global const float *restrict center,
    const float contact,
    const float pixel,
    __global float *restrict slope,
    __global uchar *restrict mask,
    __global float *restrict height,
    const int K, const int H, const int W,
    const float radius_mm,
    const float margin_px)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    const float dx = ((float)x - center[0]) * pixel;
    const float dy = ((float)y - center[1]) * pixel;
    const float square = dx * dx + dy * dy;
    const float rim = (contact - margin_px) * pixel;
    const float ball = radius_mm * radius_mm;
    const int inside = rim > 0.0f && square < rim * rim && square < ball;
    const float z = sqrt(inside ? ball - square : 1.0f);
    slope[i] = inside ? -dx / z : 0.0f;
    slope[H * W + i] = inside ? -dy / z : 0.0f;
    mask[i] = inside;
    const float reach = contact * pixel;
    height[i] = inside ? z - sqrt(fmax(ball - reach * reach, 0.0f)) : 0.0f;
}
