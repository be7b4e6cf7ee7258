#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "border.clh"
#include "springs.clh"
#include "height_system.clh"

#define STATE_AWAY 2

// The height over the frame, lowered by `by`; zero outside the window and where no pixel counts.
__kernel void place(
    __global const float *restrict z, __global const uchar *restrict state,
    __global float *restrict out, const float by, const int frame_height, const int frame_width,
    const int top, const int left, const int H, const int W)
{
    GRID_2(row, column, frame_height, frame_width)
    const int y = row - top, x = column - left;
    const int inside = y >= 0 && y < H && x >= 0 && x < W;
    const int counts = inside && state[y * W + x] != STATE_AWAY;
    out[row * frame_width + column] = counts ? z[y * W + x] - by : 0.0f;
}
