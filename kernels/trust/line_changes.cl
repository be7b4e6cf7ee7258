#include "common.clh"
#include "border.clh"
#include "group.clh"

#define REACH_PX 2

// The fourth differences of K planes of light at LANES pixels of a row, down and to the right, and
// where they count: where all pixels that they read show film.
static void differ(
    __global const float *light, __global const uchar *area, const int y, const int x,
    const int count, const int K, const int H, const int W, floats *down, floats *right,
    floats *counts)
{
    const floats none = 0.0f, one = 1.0f;
    ints shows = filled(count);
    for (int t = -REACH_PX; t <= REACH_PX; ++t) {
        __global const uchar *row = area + clamp(y + t, 0, H - 1) * W;
        shows &= load_bytes(row + x, count) != 0;
        shows &= load_bytes_within_border(area + y * W, x + t, count, W, REPLICATE) != 0;
    }
    floats falls = none, rises = none;
    for (int k = 0; k < K; ++k) {
        floats below[2 * REACH_PX + 1], beside[2 * REACH_PX + 1];
        for (int t = -REACH_PX; t <= REACH_PX; ++t) {
            __global const float *plane = light + k * H * W;
            below[t + REACH_PX] = load_floats(plane + clamp(y + t, 0, H - 1) * W + x, count);
            beside[t + REACH_PX] = load_within_border(plane + y * W, x + t, count, W, REPLICATE);
        }
        falls += fabs(below[0] + below[4] - 4.0f * (below[1] + below[3]) + 6.0f * below[2]);
        rises += fabs(beside[0] + beside[4] - 4.0f * (beside[1] + beside[3]) + 6.0f * beside[2]);
    }
    *down += shows ? falls : none;
    *right += shows ? rises : none;
    *counts += shows ? one : none;
}

// The mean differences of a row, across it and along it, v and u of equation T5.
LANED __kernel void rows(
    __global const float *restrict light,
    __global const uchar *restrict area,
    __global float *restrict across,
    __global float *restrict along,
    const int K, const int H, const int W)
{
    GRID_1(y, H)
    floats down = 0.0f, right = 0.0f, counts = 0.0f;
    for (int x = 0; x < W; x += LANES)
        differ(light, area, y, x, min(LANES, W - x), K, H, W, &down, &right, &counts);
    const float pixels = fmax((float)K * sum_of_lanes(counts), 1.0f);
    across[y] = sum_of_lanes(down) / pixels;
    along[y] = sum_of_lanes(right) / pixels;
}

// The mean differences of LANES columns, across them.
LANED __kernel void columns(
    __global const float *restrict light,
    __global const uchar *restrict area,
    __global float *restrict across,
    const int K, const int H, const int W)
{
    GRID_LANES(x, count, W)
    floats down = 0.0f, right = 0.0f, counts = 0.0f;
    for (int y = 0; y < H; ++y)
        differ(light, area, y, x, count, K, H, W, &down, &right, &counts);
    const floats one = 1.0f, pixels = (float)K * counts;
    store_floats(right / MORE_OF(pixels, one), across + x, count);
}
