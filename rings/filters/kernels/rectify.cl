#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "bicubic.clh"

// Every pixel, looked up where a homography h, from the middle of the result, leads in the images.
// A work-item does LANES pixels of a row, of all LEDs.
LANED __kernel void look_up(
    __global const float *restrict light,
    __global const float *restrict h,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float horizon)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const floats u = (float)column + LANE_NUMBERS - 0.5f * (float)(W - 1);
    const floats nearest = horizon;
    const float v = (float)row - 0.5f * (float)(H - 1);
    const floats found = h[6] * u + h[7] * v + h[8], depth = MORE_OF(found, nearest);
    const floats x = (h[0] * u + h[1] * v + h[2]) / depth;
    const floats y = (h[3] * u + h[4] * v + h[5]) / depth;
    Taps taps;
    find_taps(x, y, column, count, H, W, &taps);
    for (int k = 0; k < K; ++k) {
        const int plane = k * H * W;
        store_floats(value_at(light + plane, &taps, H, W), out + plane + row * W + column, count);
    }
}
