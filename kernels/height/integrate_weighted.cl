#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "border.clh"
#include "springs.clh"
#include "height_system.clh"

// The height over the whole frame; outside the window it is zero.
__kernel void place(
    __global const float *restrict z, __global float *restrict out, const int frame_height,
    const int frame_width, const int top, const int left, const int H, const int W)
{
    GRID_2(row, column, frame_height, frame_width)
    const int y = row - top, x = column - left;
    const int inside = y >= 0 && y < H && x >= 0 && x < W;
    out[row * frame_width + column] = inside ? z[y * W + x] : 0.0f;
}

__kernel void lower(__global float *restrict out, const int H, const int W, const float by)
{
    GRID_2(y, x, H, W)
    out[y * W + x] -= by;
}

__kernel void leave_out(
    __global const uchar *restrict mask, __global float *restrict out, const int H, const int W)
{
    GRID_2(y, x, H, W)
    out[y * W + x] *= (float)mask[y * W + x];
}
