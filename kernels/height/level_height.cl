#include "common.clh"
#include "lanes.clh"
#include "border.clh"
#include "near_light.clh"
#include "group.clh"
#include "least_squares.clh"

#define WINDOW_CELLS 5
#define MIN_REST_SHARE 0.1f
#define MIN_CURVED_SHARE 0.3f
#define DEVIATIONS_PER_MAD 1.4826f
#define PLANE_TERMS 3
#define FIT_SUMS (MAX_TERM_PAIRS + MAX_TERMS)
// Added to the diagonal, as a share of its sum: too few cells leave terms open. What it takes off in
// one round, the next rounds fit.
#define RIDGE 1e-6f
// The weight in the first round of cells inside the frame.
#define INNER_WEIGHT 1e-6f
// The distance from the surface of a cell that is not at rest.
#define TOUCHED -1.0f

// Of every `apart`th row and column of cells, the height in their middles, and its magnitude where
// film is at rest: where the light of all LEDs, averaged over a window, is 1 within the grain.
LANED __kernel void sample_cells(
    __global const float *restrict height, __global const float *restrict light,
    __global float *restrict sampled, __global float *restrict away,
    const int K, const int H, const int W, const int rows, const int columns, const int cell,
    const int apart, const float grain)
{
    GRID_PARTS_OF_ROWS(y, x, count, rows, columns)
    if (y % apart) return;
    const int row = min(y * cell + cell / 2, H - 1), across = (columns + apart - 1) / apart;
    float heights[LANES], distances[LANES];
    for (int l = 0; l < LANES; ++l)
        heights[l] = height[row * W + min((x + l) * cell + cell / 2, W - 1)];
    const floats z = LOAD_LANES(heights), none = 0.0f, touched = TOUCHED;
    ints rests = fabs(z) < (floats)INFINITY;
    for (int k = 0; k < K; ++k) {
        __global const float *plane = light + k * rows * columns;
        rests &= fabs(mean_around(plane, WINDOW_CELLS, y, x, count, rows, columns) - 1.0f) < grain;
    }
    STORE_LANES(rests ? z : none, heights);
    STORE_LANES(rests ? fabs(z) : touched, distances);
    for (int l = (apart - x % apart) % apart; l < count; l += apart) {
        const int at = y / apart * across + (x + l) / apart;
        sampled[at] = heights[l];
        away[at] = distances[l];
    }
}

// 1, u, v, u^2, u v, v^2, u^3, u^2 v, u v^2, v^3 at every `apart`th of rows x columns cells.
static void terms_at(
    floats *t, const int i, const int rows, const int columns, const int apart)
{
    const int down = (rows + apart - 1) / apart, across = (columns + apart - 1) / apart;
    const float width = (float)columns;
    floats u, v;
    places(i, down, across, 2.0f * (float)apart / width, &u, &v);
    u += (float)((across - 1) * apart - (columns - 1)) / width;
    v += (float)((down - 1) * apart - (rows - 1)) / width;
    t[0] = 1.0f;
    t[1] = u;
    t[2] = v;
    for (int j = 0; j < 3; ++j) t[3 + j] = t[j < 2 ? 1 : 2] * t[1 + min(j, 1)];
    for (int j = 0; j < 4; ++j) t[6 + j] = t[j < 3 ? 1 : 2] * t[3 + min(j, 2)];
}

// Whether a cell, of which t are the terms, lies at the border of the cells that are used.
static ints at_border(const floats *t, const int rows, const int columns, const int apart)
{
    const float width = (float)columns, left = 0.5f * (float)(columns - 1);
    const float top = 0.5f * (float)(rows - 1), step = 0.5f * (float)apart;
    const float right = (float)((columns - 1) / apart * apart) - left;
    const float bottom = (float)((rows - 1) / apart * apart) - top;
    const floats x = 0.5f * width * t[1], y = 0.5f * width * t[2];
    return (x < step - left) | (x > right - step) | (y < step - top) | (y > bottom - step);
}

// One round of a robust fit to the film at rest: the coefficients of the surface of `most` terms, or
// fewer where little film is at rest; what is `left` of the heights, and its magnitude. The first
// fits a plane to the border. As a round fits what the last one left, rounding errors of its
// equations do not stay.
LANED __kernel ONE_GROUP void fit(
    __global float *left, __global float *away,
    __global float *restrict shares, __global float *surface,
    const int rows, const int columns, const int apart, const int most, const int first)
{
    SHARED float sums[FIT_SUMS], parts[GROUP];
    const int N = (rows + apart - 1) / apart * ((columns + apart - 1) / apart);
    const int others = (int)group_count(away, N, TOUCHED, parts), resting = N - others;
    const int curved = (float)resting >= MIN_CURVED_SHARE * (float)N;
    const int enough = (float)resting >= MIN_REST_SHARE * (float)N;
    const int used = !enough ? 0 : curved && !first ? most : min(most, PLANE_TERMS);
    float per_spread = 0.0f;
    if (used && !first) {
        const float low = group_ranked(away, N, others + (resting - 1) / 2, 63, parts);
        const float high = group_ranked(away, N, others + resting / 2, 63, parts);
        per_spread = 1.0f / (0.5f * DEVIATIONS_PER_MAD * (low + high) + 1e-9f);
    }
    const floats none = 0.0f, touched = TOUCHED;
    floats mine[FIT_SUMS], t[MAX_TERMS];
    for (int j = 0; j < FIT_SUMS; ++j) mine[j] = none;
    EACH_OF_GROUP(i, count, N)
    {
        const floats far = load_floats(away + i, count), part = far * per_spread;
        const floats z = load_floats(left + i, count);
        terms_at(t, i, rows, columns, apart);
        const floats border = at_border(t, rows, columns, apart) ? none + 1.0f : none + INNER_WEIGHT;
        const floats sure = first ? border : 1.0f / (1.0f + part * part);
        const floats weight = (far > touched) & filled(count) ? sure : none;
        for (int a = 0, j = 0; a < used; ++a) {
            const floats counted = weight * t[a];
            for (int b = 0; b <= a; ++b, ++j) mine[j] += counted * t[b];
            mine[MAX_TERM_PAIRS + a] += counted * z;
        }
    }
    give_sums(mine, FIT_SUMS, shares, sums);
    float change[MAX_TERMS] = {0.0f};
    if (used) {
        float a[MAX_TERM_PAIRS], b[MAX_TERMS], trace = 0.0f;
        for (int j = 0; j < MAX_TERM_PAIRS; ++j) a[j] = sums[j];
        for (int j = 0; j < MAX_TERMS; ++j) b[j] = sums[MAX_TERM_PAIRS + j];
        for (int j = 0; j < used; ++j) trace += a[j * (j + 3) / 2];
        for (int j = 0; j < used; ++j) a[j * (j + 3) / 2] += RIDGE * trace;
        solve(a, b, change, used);
    }
    for (int j = PLACE_IN_GROUP; j < MAX_TERMS; j += GROUP)
        surface[j] = (first ? 0.0f : surface[j]) + change[j];
    EACH_OF_GROUP(i, count, N)
    {
        const floats far = load_floats(away + i, count);
        floats rest = load_floats(left + i, count);
        terms_at(t, i, rows, columns, apart);
        for (int j = 0; j < used; ++j) rest -= change[j] * t[j];
        store_floats(rest, left + i, count);
        store_floats(far > touched ? fabs(rest) : touched, away + i, count);
    }
}

// The height minus that surface.
LANED __kernel void take_off(
    __global const float *restrict height,
    __global const float *restrict surface,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_LANES(at, count, H * W)
    __global const float *c = surface;
    floats u, v;
    places(at, H, W, 2.0f / (float)W, &u, &v);
    const floats smooth = c[0] + u * (c[1] + u * (c[3] + u * c[6])) +
                          v * (c[2] + v * (c[5] + v * c[9])) + u * v * (c[4] + u * c[7] + v * c[8]);
    store_floats(load_floats(height + at, count) - smooth, out + at, count);
}
