#include "common.clh"
#include "cell_side.clh"

#define MIN_LEDS 3
#define MIN_SLOPE 0.05f
#define MAX_CURVATURE 0.5f
#define NOISE_WEIGHT 2.0f
#define NOT_TESTED (-1.0f)

// The mean of a cell of side x side pixels; beyond the border the border pixels repeat.  Rows are
// summed first, as in NumPy.
static float mean_of_cell(
    __global const float *plane, const int row, const int column, const int H, const int W,
    const int side)
{
    if (side == 1) return plane[row * W + column];
    float total = 0.0f;
    for (int j = 0; j < side; ++j) {
        float sum = 0.0f;
        for (int i = 0; i < side; ++i)
            sum += plane[min(row * side + i, H - 1) * W + min(column * side + j, W - 1)];
        total += sum;
    }
    return total * (1.0f / (float)(side * side));
}

// The curl between a cell, the one right of it and the two below, over what is expected, equation T2.
__kernel void slope_curl(
    __global const float *restrict slope,
    __global const float *restrict misfit,
    __global const uchar *restrict used,
    __global const float *restrict variance,
    __global float *restrict out,
    const int H, const int W,
    const int h, const int w,
    const int factor,
    const int cell_px,
    const float share,
    const float least)
{
    GRID_2(row, column, h, w)
    const int size = H * W, side = cell_side(H, W, factor), at = row * w + column;
    if (row == h - 1 || column == w - 1) {
        out[at] = NOT_TESTED;
        return;
    }
    float p[4], q[4], spread[4], gentlest = INFINITY;
    int fewest = 8;
    for (int c = 0; c < 4; ++c) {
        const int y = row + c / 2, x = column + c % 2;
        p[c] = mean_of_cell(slope, y, x, H, W, side);
        q[c] = mean_of_cell(slope + size, y, x, H, W, side);
        gentlest = min(gentlest, p[c] * p[c] + q[c] * q[c]);
        if (used) fewest = min(fewest, (int)popcount(used[y * side * W + x * side]));
        spread[c] = variance ? mean_of_cell(variance, y, x, H, W, side) +
                                   mean_of_cell(variance + size, y, x, H, W, side)
                             : 0.0f;
    }
    const float p_right = (p[1] - p[0] + (p[3] - p[2])) * 0.5f;
    const float p_down = (p[2] - p[0] + (p[3] - p[1])) * 0.5f;
    const float q_right = (q[1] - q[0] + (q[3] - q[2])) * 0.5f;
    const float q_down = (q[2] - q[0] + (q[3] - q[1])) * 0.5f;
    const float bent =
        p_right * p_right + p_down * p_down + q_right * q_right + q_down * q_down;
    const int tests = gentlest > MIN_SLOPE * MIN_SLOPE && fewest >= MIN_LEDS &&
                      bent < MAX_CURVATURE * MAX_CURVATURE;
    const float pixels = (float)(side * cell_px) * (float)(side * cell_px);
    const float noise = (spread[0] + spread[1] + (spread[2] + spread[3])) * 0.25f / pixels;
    const float curl = p_down - q_right;
    const float expected =
        least * least + misfit[0] * misfit[0] + share * share * bent + NOISE_WEIGHT * noise;
    out[at] = tests ? curl * curl / expected : NOT_TESTED;
}
