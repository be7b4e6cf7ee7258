// Equation H1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define UNKNOWN_VARIANCE 1e6f
#define SMOOTH_VARIANCE 1.0f
#define LONE_SLOPE_VARIANCE 4.0f
#define MAX_LONE_VARIANCE 1e3f
#define STATE_REST 1
#define STATE_AWAY 2

// Steps in px from slopes before, at both ends of, and after a spring, and their variances.
static void steps_between(
    const floats *slope, const floats *variance, const ints amid, const float bend,
    const float least_spread, floats *wanted, floats *spread)
{
    const floats before = slope[1], after = slope[2], none = 0.0f, most = MAX_LONE_VARIANCE;
    const floats var_before = variance[1], var_after = variance[2];
    const ints smooth = (variance[0] < SMOOTH_VARIANCE) & (variance[3] < SMOOTH_VARIANCE);
    const floats curve = (before + after - (slope[0] + slope[3])) / 16.0f;
    const floats limit = 0.25f * fabs(after - before), up = MORE_OF(curve, -limit);
    floats step_ = 0.5f * (before + after);
    step_ += amid & smooth ? LESS_OF(up, limit) : none;
    const floats turned = bend * (after - before);
    const floats both = 0.25f * (var_before + var_after) + turned * turned;
    const floats least = LESS_OF(var_before, var_after);
    const ints certain = MORE_OF(var_before, var_after) < UNKNOWN_VARIANCE;
    const floats surer = var_before < var_after ? before : after;
    // A wall ends within the pixel that shows it.
    const floats little = LESS_OF(least, most) + LONE_SLOPE_VARIANCE + surer * surer;
    const floats alone = both == INFINITY ? both : little;
    *wanted = certain ? step_ : surer;
    *spread = (certain ? both : alone) + least_spread;
}

// Slopes, and their variances, at the pixels before, at and after springs.
static void load_ends(
    __global const float *slope, __global const float *variance, __global const uchar *mask,
    const int n, const int row, const int x, const int count, const int W, floats *slopes,
    floats *variances)
{
    const floats infinite = INFINITY;
    slopes[n] = load_within_border(slope + row, x, count, W, REPLICATE);
    variances[n] = load_within_border(variance + row, x, count, W, REPLICATE);
    if (mask) {
        const ints counts = load_bytes_within_border(mask + row, x, count, W, REPLICATE);
        variances[n] = counts != 0 ? variances[n] : infinite;
    }
}

// The steps to the right and down in mm, with their variances, and which pixels are at rest, or do
// not count.
LANED __kernel void gather_system(
    __global const float *restrict slope, __global const float *restrict variance,
    __global const uchar *restrict rest, __global const uchar *mask,
    __global float *restrict right, __global float *restrict down,
    __global float *restrict right_variance, __global float *restrict down_variance,
    __global uchar *restrict state, const int frame_size, const int frame_width, const int top,
    const int left, const int H, const int W, const float pixel, const float bend,
    const float least_spread)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const floats none = 0.0f, infinite = INFINITY;
    const ints still = STATE_REST, out = STATE_AWAY;
    const int i = y * W + x, here = (top + y) * frame_width + left;
    const floats column = (float)x + LANE_NUMBERS, last = (float)(W - 1);
    floats slopes[4], variances[4], wanted, spread;
    for (int n = 0; n < 4; ++n)
        load_ends(slope, variance, mask, n, here, x - 1 + n, count, W, slopes, variances);
    const ints amid = (column > 0.0f) & (column + 1.0f < last), beside = column < last;
    steps_between(slopes, variances, amid, bend, least_spread, &wanted, &spread);
    store_floats(beside ? wanted * pixel : none, right + i, count);
    store_floats(beside ? spread * pixel * pixel : infinite, right_variance + i, count);
    for (int n = 0; n < 4; ++n) {
        const int row = (top + clamp(y - 1 + n, 0, H - 1)) * frame_width + left;
        load_ends(
            slope + frame_size, variance + frame_size, mask, n, row, x, count, W, slopes,
            variances);
    }
    const floats row = (float)y, lowest = (float)(H - 1);
    const ints between = (row > 0.0f) & (row + 1.0f < lowest), below = row < lowest;
    steps_between(slopes, variances, between, bend, least_spread, &wanted, &spread);
    store_floats(below ? wanted * pixel : none, down + i, count);
    store_floats(below ? spread * pixel * pixel : infinite, down_variance + i, count);
    const ints free_ = 0;
    ints result = load_bytes(rest + here + x, count) != 0 ? still : free_;
    if (mask) result = load_bytes(mask + here + x, count) != 0 ? result : out;
    store_bytes(result, state + i, count);
}
