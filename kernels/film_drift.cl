#include "common.clh"
#include "cells.clh"
#include "float_keys.clh"

#define GROUP 64
#define TERMS 6
#define PAIRS 21
#define MOST 8
#define SUMS (PAIRS + MOST * (TERMS + 1))
#define WORKERS 256
#define DARKEST 0.02f
#define FEWEST 0.05f
#define HELD 0.003f
#define AROUND 5

static void terms_at(float *t, const int i, const int H, const int W)
{
    const int y = i / W, x = i % W;
    const float scale = 2.0f / (float)W;
    const float u = ((float)x - 0.5f * (float)(W - 1)) * scale;
    const float v = ((float)y - 0.5f * (float)(H - 1)) * scale;
    t[0] = 1.0f;
    t[1] = u;
    t[2] = v;
    t[3] = u * u;
    t[4] = u * v;
    t[5] = v * v;
}

static float gain_at(__global const float *c, const float *t)
{
    float gain = 0.0f;
    for (int j = 0; j < TERMS; ++j) gain += c[j] * t[j];
    return gain;
}

// What of a cell's light counts as noise.
static float share_of(__global const float *sigma, const float share, const int i)
{
    return share > 0.0f ? share * sigma[i] : 0.0f;
}

// The mean of what lies around each cell; beyond the frame its border goes on.
__kernel void look_around(
    __global const float *restrict light, __global float *restrict around,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    float total = 0.0f;
    for (int dy = -(AROUND / 2); dy <= AROUND / 2; ++dy)
        for (int dx = -(AROUND / 2); dx <= AROUND / 2; ++dx)
            total += light[(k * H + clamp(y + dy, 0, H - 1)) * W + clamp(x + dx, 0, W - 1)];
    around[(k * H + y) * W + x] = total / (float)(AROUND * AROUND);
}

static int is_calm(
    __global const float *light,
    __global const float *sigma,
    __global const float *drift,
    const float *t,
    const int i, const int K, const int size,
    const float share,
    const float beyond)
{
    for (int k = 0; k < K; ++k) {
        const float gain = gain_at(drift + TERMS * k, t), mean = light[k * size + i];
        if (!(fabs(mean - gain) < gain * (share_of(sigma, share, k * size + i) + beyond))) return 0;
    }
    return 1;
}

// The place number j of the outermost ring of H x W cells.
static int on_ring(const int j, const int H, const int W)
{
    if (j < W) return j;
    if (j < 2 * W) return (H - 1) * W + j - W;
    const int side = j - 2 * W;
    return (1 + side / 2) * W + (side & 1 ? W - 1 : 0);
}

__kernel void halve(
    __global const float *restrict light,
    __global float *restrict halved,
    const int K, const int h, const int w,
    const int H, const int W)
{
    GRID_3(k, y, x, K, h, w)
    halved[(k * h + y) * w + x] = mean_of_cell(light + k * H * W, y, x, H, W, 2);
}

__kernel void begin(
    __global const float *before, __global float *restrict old, __global int *heed,
    const int has_before, const int K)
{
    GRID_1(i, TERMS * K)
    if (i == 0) heed[0] = 0;
    old[i] = has_before ? before[i] : i % TERMS == 0 ? 1.0f : 0.0f;
}

// The drift before, times the lower median of light over it along the border: by bisection
// on the bits, a work-group per LED.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void border_level(
    __global const float *restrict light,
    __global const float *restrict old,
    __global float *restrict other,
    const int H, const int W)
{
    __local int counts[GROUP];
    __local uint low, high;
    const int me = get_local_id(0), k = get_group_id(0);
    const int thin = min(H, W) <= 2;
    const int ring = thin ? H * W : 2 * W + 2 * (H - 2);
    if (me == 0) {
        low = 0u;
        high = 0xffffffffu;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int bit = 0; bit < 32; ++bit) {
        const uint pivot = low + (high - low) / 2;
        int below = 0;
        for (int j = me; j < ring; j += GROUP) {
            const int i = thin ? j : on_ring(j, H, W);
            float t[TERMS];
            terms_at(t, i, H, W);
            const float gain = fmax(gain_at(old + TERMS * k, t), DARKEST);
            below += key_of(light[k * H * W + i] / gain) <= pivot;
        }
        counts[me] = below;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (me == 0) {
            int total = 0;
            for (int i = 0; i < GROUP; ++i) total += counts[i];
            if (total > (ring - 1) / 2) high = pivot;
            else low = pivot + 1;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (me < TERMS) other[TERMS * k + me] = value_of(low) * old[TERMS * k + me];
}

__kernel void count_calm(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict old,
    __global const float *restrict other,
    __global int *restrict counts,
    const int K, const int H, const int W,
    const float share,
    const float beyond)
{
    GRID_1(me, WORKERS)
    int calm[2] = {0, 0};
    for (int i = me; i < H * W; i += WORKERS) {
        float t[TERMS];
        terms_at(t, i, H, W);
        calm[0] += is_calm(light, sigma, old, t, i, K, H * W, share, beyond);
        calm[1] += is_calm(light, sigma, other, t, i, K, H * W, share, beyond);
    }
    counts[2 * me] = calm[0];
    counts[2 * me + 1] = calm[1];
}

// Start from the drift under which more of the film is calm.
__kernel void choose(
    __global const float *restrict old,
    __global const float *restrict other,
    __global const int *restrict counts,
    __global float *restrict drift,
    const int K)
{
    GRID_1(i, TERMS * K)
    int more = 0;
    for (int g = 0; g < WORKERS; ++g) more += counts[2 * g + 1] - counts[2 * g];
    drift[i] = more > 0 ? other[i] : old[i];
}

// How many cells are calm, and so is what lies around them.
__kernel void count_clear(
    __global const float *restrict light,
    __global const float *restrict around,
    __global const float *restrict sigma,
    __global const float *judge,
    __global int *restrict counts,
    const int K, const int H, const int W,
    const float share,
    const float beyond)
{
    GRID_1(me, WORKERS)
    int clear = 0;
    for (int i = me; i < H * W; i += WORKERS) {
        float t[TERMS];
        terms_at(t, i, H, W);
        clear += is_calm(light, sigma, judge, t, i, K, H * W, share, beyond)
            && is_calm(around, sigma, judge, t, i, K, H * W, share / AROUND, beyond);
    }
    counts[me] = clear;
}

// Whether what lies around a cell has to be calm too: if enough is left.
__kernel void heed_around(
    __global const int *restrict counts, __global int *heed, const int size)
{
    if (get_global_id(0) > 0) return;
    int clear = 0;
    for (int g = 0; g < WORKERS; ++g) clear += counts[g];
    heed[0] = clear >= FEWEST * (float)size;
}

// Sums over the cells that are calm under `judge`, of what `known` leaves.
__kernel void tally(
    __global const float *restrict light,
    __global const float *restrict around,
    __global const int *heed,
    __global const float *restrict sigma,
    __global const float *judge,
    __global const float *known,
    __global float *restrict sums,
    const int K, const int H, const int W,
    const float share,
    const float beyond)
{
    GRID_1(me, WORKERS)
    const int size = H * W;
    float mine[SUMS];
    for (int j = 0; j < SUMS; ++j) mine[j] = 0.0f;
    for (int i = me; i < size; i += WORKERS) {
        float t[TERMS];
        terms_at(t, i, H, W);
        if (!is_calm(light, sigma, judge, t, i, K, size, share, beyond)) continue;
        if (heed[0] && !is_calm(around, sigma, judge, t, i, K, size, share / AROUND, beyond))
            continue;
        for (int a = 0, j = 0; a < TERMS; ++a)
            for (int b = 0; b <= a; ++b, ++j) mine[j] += t[a] * t[b];
        for (int k = 0; k < K; ++k) {
            const float left = light[k * size + i] - gain_at(known + TERMS * k, t);
            for (int a = 0; a < TERMS; ++a) mine[PAIRS + TERMS * k + a] += t[a] * left;
            const float chance = share_of(sigma, share, k * size + i);
            mine[PAIRS + MOST * TERMS + k] += chance * chance;
        }
    }
    for (int j = 0; j < SUMS; ++j) sums[j * WORKERS + me] = mine[j];
}

static float total_of(__global const float *sums, const int j)
{
    float total = 0.0f;
    for (int g = 0; g < WORKERS; ++g) total += sums[j * WORKERS + g];
    return total;
}

// x with A x = b by Cholesky; A symmetric, its rows below the diagonal.
static void solve(const float *a, const float *b, float *x, const int n)
{
    float l[PAIRS];
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

// The drift of an LED from the sums: `next`; its shape follows by `rate`.
__kernel void settle(
    __global const float *restrict sums,
    __global const float *restrict old,
    __global float *restrict next,
    __global float *restrict explained,
    const int K, const int size,
    const int count,
    const float rate)
{
    GRID_1(k, K)
    float a[PAIRS], b[TERMS], change[TERMS];
    for (int j = 0; j < PAIRS; ++j) a[j] = total_of(sums, j);
    // Without calm film the sums are empty; what comes out is not used.
    a[0] = fmax(a[0], 1.0f);
    for (int j = 1; j < TERMS; ++j) a[j * (j + 3) / 2] += HELD * (float)size;
    for (int j = 0; j < TERMS; ++j) b[j] = total_of(sums, PAIRS + TERMS * k + j);
    solve(a, b, change, count);
    explained[k] = 0.0f;
    for (int j = 0; j < TERMS; ++j) {
        next[TERMS * k + j] = old[TERMS * k + j];
        if (j >= count) continue;
        explained[k] += change[j] * b[j];
        next[TERMS * k + j] += j > 0 ? rate * change[j] : change[j];
    }
}

// Remember whether too little of the film was calm in any round.
__kernel void watch(__global const float *restrict sums, __global int *few, const int size,
                    const int first)
{
    if (get_global_id(0) > 0) return;
    const int now = total_of(sums, 0) < FEWEST * (float)size;
    few[0] = first ? now : few[0] || now;
}

// The level once more, and the old drift where nothing real was found.
__kernel void finish(
    __global const float *restrict sums,
    __global const float *restrict old,
    __global const float *restrict drift,
    __global const float *restrict explained,
    __global const int *restrict few,
    __global float *restrict out,
    const int K,
    const float doubt)
{
    GRID_1(k, K)
    const float calm = fmax(total_of(sums, 0), 1.0f);
    const float chance = total_of(sums, PAIRS + MOST * TERMS + k) / calm;
    const int real = !few[0] && explained[k] > doubt * chance;
    for (int j = 0; j < TERMS; ++j) {
        const float level = j == 0 ? total_of(sums, PAIRS + TERMS * k) / calm : 0.0f;
        out[TERMS * k + j] = real ? drift[TERMS * k + j] + level : old[TERMS * k + j];
    }
}
