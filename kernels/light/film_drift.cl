#include "common.clh"
#include "lanes.clh"
#include "border.clh"
#include "near_light.clh"
#include "pixels.clh"
#include "cells.clh"
#include "group.clh"
#include "drift.clh"
#include "ring.clh"

#define DRIFT_TERMS 6
#define TERM_PAIRS 21
#define MAX_LEDS 8
#define COUNTED TERM_PAIRS
#define MEASURED (COUNTED + 1)
#define CHANCE (MEASURED + MAX_LEDS * DRIFT_TERMS)
#define FIT_SUMS (CHANCE + MAX_LEDS)
#define MIN_CALM_SHARE 0.05f
#define SHAPE_REGULARISATION 0.003f
#define WINDOW_CELLS 5
#define TOUCH_DEPARTURE 0.003f
#define SKIRT_CELLS 5
#define SLOPE_COMPONENTS 2
#define FALSE_ALARMS 0.01f
#define NOT_CALM -1.0f
#define MIN_WEIGHT 1e-6f
// The contents of `counts`: whether too few cells were calm in a round, how many are clear, and the
// square root of the greatest weight of a cell.
#define TOO_FEW 0
#define CLEAR 1
#define FURTHEST 2

// K x H x W cells: light, and noise, which counts times `share`.
typedef struct {
    __global const float *light, *sigma;
    int K, H, W;
    float share;
} Film;

LANED __kernel void take_off(
    __global const float *restrict light, __global const float *restrict bounced,
    __global const float *restrict thrown, __global const float *restrict share,
    __global float *restrict direct, const int N)
{
    GRID_LANES(i, count, N)
    floats more = load_floats(bounced + i, count);
    if (thrown && share) {
        more = (more - load_floats(thrown + i, count)) / load_floats(share + i, count);
    }
    store_floats(load_floats(light + i, count) - more, direct + i, count);
}

LANED __kernel void halve(
    __global const float *restrict light,
    __global float *restrict halved,
    const int K, const int h, const int w,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, K * h, w)
    const int k = row / h;
    const floats mean = mean_of_cells(light + k * H * W, row - k * h, column, H, W, 2);
    store_floats(mean, halved + row * w + column, count);
}

// The mean over the window around each cell; beyond the frame the border repeats.
LANED __kernel void look_around(
    __global const float *restrict light, __global float *restrict around,
    const int K, const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, x, count, K * H, W)
    const int k = row / H, y = row - k * H;
    floats total = 0.0f;
    for (int dy = -(WINDOW_CELLS / 2); dy <= WINDOW_CELLS / 2; ++dy) {
        __global const float *line = light + (k * H + clamp(y + dy, 0, H - 1)) * W;
        for (int dx = -(WINDOW_CELLS / 2); dx <= WINDOW_CELLS / 2; ++dx)
            total += load_within_border(line, x + dx, count, W, REPLICATE);
    }
    const floats mean = total / (float)(WINDOW_CELLS * WINDOW_CELLS);
    store_floats(mean, around + row * W + x, count);
}

// 1, u, v, u^2, u v, v^2.
static void terms_of(floats *t, const floats u, const floats v)
{
    t[0] = 1.0f;
    t[1] = u;
    t[2] = v;
    t[3] = u * u;
    t[4] = u * v;
    t[5] = v * v;
}

// The same at consecutive cells.
static void terms_at(floats *t, const int i, const int H, const int W)
{
    floats u, v;
    places(i, H, W, 2.0f / (float)W, &u, &v);
    terms_of(t, u, v);
}

static floats gain_of(__global const float *c, const floats *t)
{
    floats gain = c[0];
    for (int j = 1; j < DRIFT_TERMS; ++j) gain += c[j] * t[j];
    return gain;
}

// Whether the light of all LEDs agrees with the drift, within the noise and `beyond`.
static ONCE ints is_calm(
    const Film *film, __global const float *light, __global const float *drift, const floats *t,
    const int i, const int count, const float share, const float beyond)
{
    ints calm = filled(count);
    for (int k = 0; k < film->K; ++k) {
        const int at = k * film->H * film->W + i;
        const floats gain = gain_of(drift + DRIFT_TERMS * k, t), none = 0.0f;
        const floats noise = share > 0.0f ? share * load_floats(film->sigma + at, count) : none;
        calm &= fabs(load_floats(light + at, count) - gain) < gain * (noise + beyond);
    }
    return calm;
}

// Cells count where they are calm.
LANED __kernel void weigh_calm(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict drift,
    __global float *restrict weights,
    const int K, const int H, const int W,
    const float share,
    const float beyond)
{
    GRID_LANES(i, count, H * W)
    const Film film = {light, sigma, K, H, W, share};
    const floats one = 1.0f, none = 0.0f;
    floats t[DRIFT_TERMS];
    terms_at(t, i, H, W);
    const ints calm = is_calm(&film, light, drift, t, i, count, share, beyond);
    store_floats(calm ? one : none, weights + i, count);
}

// 1 where a cell and the mean around it are calm, 0 where the cell alone is, else NOT_CALM, and the
// number of the first; and 1 where no touch shows around a cell, else 0.
LANED __kernel void find_clear(
    __global const float *restrict light,
    __global const float *restrict around,
    __global const float *restrict sigma,
    __global const float *restrict drift,
    __global float *restrict clear,
    __global float *restrict still,
    __global int *restrict counts,
    const int K, const int H, const int W,
    const float share,
    const float beyond)
{
    GRID_LANES(i, count, H * W)
    const Film film = {light, sigma, K, H, W, share};
    const floats one = 1.0f, none = 0.0f, not_calm = NOT_CALM;
    const float less = share / WINDOW_CELLS;
    floats t[DRIFT_TERMS];
    terms_at(t, i, H, W);
    const ints calm = is_calm(&film, light, drift, t, i, count, share, beyond);
    const ints wide = is_calm(&film, around, drift, t, i, count, less, beyond);
    const ints untouched = is_calm(&film, around, drift, t, i, count, less,
        beyond + TOUCH_DEPARTURE);
    store_floats(calm ? (wide ? one : none) : not_calm, clear + i, count);
    store_floats(untouched ? one : none, still + i, count);
    atomic_add(counts + CLEAR, (int)sum_of_lanes(calm & wide & filled(count) ? one : none));
}

// Clear cells weigh the square of their distance in cells from the touch, at most SKIRT_CELLS + 1;
// all calm cells weigh the same where too few are clear.
LANED __kernel void weigh_clear(
    __global const float *restrict clear,
    __global const float *restrict still,
    __global int *restrict counts,
    __global float *restrict weights,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const floats here = load_floats(clear + y * W + x, count), one = 1.0f, none = 0.0f;
    floats nearest = SKIRT_CELLS + 1.0f;
    for (int dy = -SKIRT_CELLS; dy <= SKIRT_CELLS; ++dy) {
        __global const float *line = still + clamp(y + dy, 0, H - 1) * W;
        for (int dx = -SKIRT_CELLS; dx <= SKIRT_CELLS; ++dx) {
            const floats distance = (float)max(abs(dy), abs(dx));
            const floats there = load_within_border(line, x + dx, count, W, REPLICATE);
            nearest = there > 0.0f ? nearest : LESS_OF(nearest, distance);
        }
    }
    const floats far = (here > 0.0f) & filled(count) ? nearest : none;
    const floats alike = here > NOT_CALM ? one : none;
    const int enough = (float)counts[CLEAR] >= MIN_CALM_SHARE * (float)(H * W);
    store_floats(enough ? far * far : alike, weights + y * W + x, count);
    if (enough) atomic_max(counts + FURTHEST, (int)highest_lane(far));
}

// The lower median of the light of LED k over its drift, along the border.
static ONCE float border_level(
    const Film *film, const int k, __global const float *c, __global float *ring,
    SHARED float *parts)
{
    const int H = film->H, W = film->W;
    const int size = ring_size(H, W, 1);
    const float scale = 2.0f / (float)W;
    for (int j = PLACE_IN_GROUP; j < size; j += GROUP) {
        const int at = on_ring(j, H, W, 1), row = at / W;
        const float u = ((float)(at - row * W) - 0.5f * (float)(W - 1)) * scale;
        const float v = ((float)row - 0.5f * (float)(H - 1)) * scale;
        const float gain =
            c[0] + c[1] * u + c[2] * v + c[3] * (u * u) + c[4] * (u * v) + c[5] * (v * v);
        ring[j] = film->light[k * H * W + at] / fmax(gain, MIN_GAIN);
    }
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    const float level = group_median(ring, size, parts);
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    return level;
}

// Weighted sums over the cells: of the products of the first `used` terms, of terms times the light
// minus `before` by LED, and of the noise's square by LED; and the number of cells that count.
static ONCE void tally(
    const Film *film, __global const float *weights, __global const float *before,
    const int used, __global float *shares, SHARED float *sums)
{
    const floats one = 1.0f, none = 0.0f;
    floats mine[FIT_SUMS];
    // A bound that compilers do not know: unrolled, these loops took a sixth of their time.
    const int last = FIT_SUMS - MAX_LEDS + film->K;
    for (int j = 0; j < last; ++j) mine[j] = none;
    EACH_OF_GROUP(i, count, film->H * film->W)
    {
        const floats here = load_floats(weights + i, count);
        const floats weight = filled(count) ? here : none;
        if (!ANY(weight > 0.0f)) continue;
        mine[COUNTED] += weight > 0.0f ? one : none;
        floats t[DRIFT_TERMS], counted[DRIFT_TERMS];
        terms_at(t, i, film->H, film->W);
        for (int a = 0; a < used; ++a) counted[a] = weight * t[a];
        for (int a = 0, j = 0; a < used; ++a)
            for (int b = 0; b <= a; ++b, ++j) mine[j] += counted[a] * t[b];
        for (int k = 0; k < film->K; ++k) {
            const int at = k * film->H * film->W + i;
            const floats excess = load_floats(film->light + at, count)
                - gain_of(before + DRIFT_TERMS * k, t);
            for (int a = 0; a < used; ++a)
                mine[MEASURED + DRIFT_TERMS * k + a] += counted[a] * excess;
            if (film->share <= 0.0f) continue;
            const floats chance = film->share * load_floats(film->sigma + at, count);
            mine[CHANCE + k] += weight * chance * chance;
        }
    }
    for (int j = 0; j < last; ++j) shares[last * PLACE_IN_GROUP + j] = sum_of_lanes(mine[j]);
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    for (int half_ = last * GROUP / 2; half_ >= last; half_ /= 2) {
        for (int j = PLACE_IN_GROUP; j < half_; j += GROUP) shares[j] += shares[j + half_];
        WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    }
    for (int j = PLACE_IN_GROUP; j < last; j += GROUP) sums[j] = shares[j];
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
}

// x with A x = b by Cholesky; A symmetric, its rows below the diagonal.
static void solve(const float *a, const float *b, float *x, const int n)
{
    float l[TERM_PAIRS];
    for (int i = 0; i < n; ++i)
        for (int j = 0; j <= i; ++j) {
            float sum = a[i * (i + 1) / 2 + j];
            for (int m = 0; m < j; ++m) sum -= l[i * (i + 1) / 2 + m] * l[j * (j + 1) / 2 + m];
            l[i * (i + 1) / 2 + j] = i == j ? sqrt(sum) : sum / l[j * (j + 1) / 2 + j];
        }
    for (int i = 0; i < n; ++i) {
        float sum = b[i];
        for (int m = 0; m < i; ++m) sum -= l[i * (i + 1) / 2 + m] * x[m];
        x[i] = sum / l[i * (i + 1) / 2 + i];
    }
    for (int i = n - 1; i >= 0; --i) {
        float sum = x[i];
        for (int m = i + 1; m < n; ++m) sum -= l[m * (m + 1) / 2 + i] * x[m];
        x[i] = sum / l[i * (i + 1) / 2 + i];
    }
}

// The change of the drift of LED k from the sums: its mean, then its shape; and the sum of squares
// that it explains.
static ONCE float solve_change(
    SHARED const float *sums, SHARED float *change, const int k, const int used, const float held)
{
    float a[TERM_PAIRS], b[DRIFT_TERMS], x[DRIFT_TERMS], explained = 0.0f;
    for (int j = 0; j < used * (used + 1) / 2; ++j) a[j] = sums[j];
    // Without calm film the sums are empty, and the result is not used.
    a[0] = fmax(a[0], MIN_WEIGHT);
    for (int j = 1; j < used; ++j) a[j * (j + 3) / 2] += held;
    for (int j = 0; j < used; ++j) b[j] = sums[MEASURED + DRIFT_TERMS * k + j];
    solve(a, b, x, used);
    for (int j = 0; j < used; ++j) {
        change[DRIFT_TERMS * k + j] = j > 0 ? x[j] : b[0] / a[0];
        explained += x[j] * b[j];
    }
    return explained;
}

// The sum of squares, about its mean, of a shape on the cells that count.
static float squares_of(SHARED const float *sums, SHARED const float *shape, const int used)
{
    float total = 0.0f, mean = 0.0f;
    for (int a = 1; a < used; ++a) {
        mean += shape[a] * sums[a * (a + 1) / 2];
        for (int b = 1; b < used; ++b)
            total += shape[a] * shape[b] * sums[max(a, b) * (max(a, b) + 1) / 2 + min(a, b)];
    }
    return total - mean * mean / fmax(sums[0], MIN_WEIGHT);
}

// The change along one of two orthonormal patterns over the LEDs, which a slope along x and along y
// makes.
static void change_along(
    SHARED float *change, __global const float *lights, const int pattern, const int K,
    const int used)
{
    SHARED float *along = change + DRIFT_TERMS * (K + pattern);
    float xx = 0.0f, xy = 0.0f, norm = 0.0f;
    for (int k = 0; k < K; ++k) {
        const float x = lights[3 * k] / lights[3 * k + 2];
        xx += x * x;
        xy += x * lights[3 * k + 1] / lights[3 * k + 2];
    }
    for (int j = 0; j < used; ++j) along[j] = 0.0f;
    for (int k = 0; k < K; ++k) {
        const float x = lights[3 * k] / lights[3 * k + 2];
        const float across = lights[3 * k + 1] / lights[3 * k + 2] - xy / xx * x;
        const float part = pattern ? across : x;
        norm += part * part;
        for (int j = 0; j < used; ++j) along[j] += part * change[DRIFT_TERMS * k + j];
    }
    for (int j = 0; j < used; ++j) along[j] /= sqrt(norm);
}

// The share of the LEDs' changes that is drift and no slope, from their sums of squares, and from those
// along the two patterns.  All is drift unless the latter, of so many terms, are more than chance.
static float drift_share(SHARED const float *squares, const int K, const int terms)
{
    const int others = K - SLOPE_COMPONENTS;
    float total = 0.0f, chance = 0.0f;
    for (int k = 0; k < K; ++k) total += squares[k];
    const float sloped = squares[K] + squares[K + 1], rest = fmax(total - sloped, 0.0f);
    if (others < 1 || total <= 0.0f) return 1.0f;
    const float values = 0.5f * (float)(terms * others);
    float part = pow(rest / total, values);
    for (int j = 0; j < terms; ++j) {
        chance += part;
        part *= (values + (float)j) / (float)(j + 1) * (1.0f - rest / total);
    }
    if (chance > FALSE_ALARMS || sloped <= 0.0f) return 1.0f;
    return fmin(1.0f, SLOPE_COMPONENTS * rest / ((float)others * sloped));
}

// The next drift of LED k: the old one, and a change of its shape by `rate` and of its level at once.
static ONCE void settle(
    SHARED const float *sums, SHARED const float *change, __global const float *old,
    __global float *next, const int k, const int used, const float rate, const int significant)
{
    float level = sums[MEASURED + DRIFT_TERMS * k];
    for (int j = 0; j < DRIFT_TERMS; ++j) {
        const int at = DRIFT_TERMS * k + j;
        const float more = significant && 0 < j && j < used ? rate * change[at] : 0.0f;
        next[at] = old[at] + more;
        if (j > 0) level -= more * sums[j * (j + 1) / 2];
    }
    if (significant) next[DRIFT_TERMS * k] += level / fmax(sums[0], MIN_WEIGHT);
}

// The old drift, and the start: that drift, or scaled to the border if this makes more film calm.
LANED __kernel ONE_GROUP void begin(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *before,
    __global float *restrict ring,
    __global float *old,
    __global float *drift,
    __global int *counts,
    const int K, const int H, const int W,
    const int has_before,
    const float share,
    const float beyond)
{
    SHARED float parts[GROUP];
    const int me = PLACE_IN_GROUP;
    const Film film = {light, sigma, K, H, W, share};
    for (int i = me; i < DRIFT_TERMS * K; i += GROUP)
        old[i] = has_before ? before[i] : i % DRIFT_TERMS == 0 ? 1.0f : 0.0f;
    if (me == 0) counts[TOO_FEW] = counts[CLEAR] = 0, counts[FURTHEST] = 1;
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    for (int k = 0; k < K; ++k) {
        const float level = border_level(&film, k, old + DRIFT_TERMS * k, ring, parts);
        for (int j = me; j < DRIFT_TERMS; j += GROUP)
            drift[DRIFT_TERMS * k + j] = level * old[DRIFT_TERMS * k + j];
    }
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    const floats one = 1.0f, none = 0.0f;
    floats more = none;
    EACH_OF_GROUP(i, count, H * W)
    {
        floats t[DRIFT_TERMS];
        terms_at(t, i, H, W);
        more += is_calm(&film, light, drift, t, i, count, share, beyond) ? one : none;
        more -= is_calm(&film, light, old, t, i, count, share, beyond) ? one : none;
    }
    WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
    const int better = group_sum(more, parts) > 0.0f;
    for (int i = me; i < DRIFT_TERMS * K; i += GROUP) drift[i] = better ? drift[i] : old[i];
}

// The next drift, from the cells that count; the old one once too few did.  `doubt` is above 0 in the
// last round: where few cells are clear, skirts may depart alike by noise and `alike`, a square.
LANED __kernel ONE_GROUP void fit(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict weights,
    __global const float *restrict old,
    __global const float *restrict lights,
    __global float *restrict next,
    __global float *restrict shares,
    __global int *restrict counts,
    const int K, const int H, const int W,
    const int used,
    const float share,
    const float rate,
    const float doubt,
    const float alike)
{
    SHARED float sums[FIT_SUMS], change[(MAX_LEDS + SLOPE_COMPONENTS) * DRIFT_TERMS];
    SHARED float explained[MAX_LEDS];
    SHARED float levels[MAX_LEDS + SLOPE_COMPONENTS], shapes[MAX_LEDS + SLOPE_COMPONENTS];
    const int me = PLACE_IN_GROUP, before = counts[TOO_FEW], furthest = counts[FURTHEST];
    const Film film = {light, sigma, K, H, W, share};
    tally(&film, weights, old, used, shares, sums);
    const float size = (float)(H * W), counted = sums[COUNTED];
    const int too_few = before || counted < MIN_CALM_SHARE * size;
    const float held = SHAPE_REGULARISATION * size * sums[0] / fmax(counted, 1.0f);
    const int on_skirts = (float)counts[CLEAR] < MIN_CALM_SHARE * size;
    const float averaged = (float)(furthest * furthest) / fmax(sums[0], MIN_WEIGHT);
    for (int k = me; k < K; k += GROUP) explained[k] = solve_change(sums, change, k, used, held);
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
    const int patterns = lights ? SLOPE_COMPONENTS : 0;
    for (int k = me; k < K + patterns; k += GROUP) {
        if (k >= K) change_along(change, lights, k - K, K, used);
        levels[k] = change[DRIFT_TERMS * k] * change[DRIFT_TERMS * k];
        shapes[k] = squares_of(sums, change + DRIFT_TERMS * k, used);
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
    const float of_level = patterns ? drift_share(levels, K, 0) : 1.0f;
    const float of_shape = patterns ? drift_share(shapes, K, used - 1) : 1.0f;
    for (int k = me; k < K; k += GROUP) {
        const float noise = sums[CHANCE + k], level = levels[k] * sums[0];
        const float drifted = of_level * level + of_shape * (explained[k] - level);
        const float chance = on_skirts ? noise + alike * sums[0] : noise * averaged;
        const float most = on_skirts && doubt > 0.0f ? drifted : explained[k];
        const int significant = !too_few && most > doubt * chance;
        settle(sums, change, old, next, k, used, rate * of_shape, significant);
    }
    if (me == 0) counts[TOO_FEW] = too_few;
}
