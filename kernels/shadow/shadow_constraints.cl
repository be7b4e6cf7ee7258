#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define HALF 0.5f
#define FAINTEST 0.02f
#define STEEPEST 3.0f
#define FARTHEST_END 1.5f
#define NEAREST_EDGE 1.2f
#define NOTHING -1

// The share (0 to 1) of its light that each pixel gets from each LED.
__kernel void lit_part(
    __global const float *restrict light, __global const float *restrict slope,
    __global const float *restrict height, __global const float *restrict lights,
    __global float *restrict part, const int K, const int H, const int W, const float pixel)
{
    const int size = H * W;
    GRID_LANES(i, count, size)
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats steep = sqrt(1.0f + p * p + q * q), nothing = 0.0f, all = 1.0f;
    const floats z = load_floats(height + i, count), faintest = FAINTEST;
    floats x, y;
    places(i, H, W, pixel, &x, &y);
    for (int k = 0; k < K; ++k) {
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats expected = (v.z - p * v.x - q * v.y) / steep;
        const floats share =
            load_floats(light + k * size + i, count) / MORE_OF(expected, faintest);
        const floats some = MORE_OF(share, nothing);
        store_floats(LESS_OF(some, all), part + k * size + i, count);
    }
}

// Four pixels around a point, and how far between them it lies.
typedef struct {
    int a, b, c, d;
    float u, v;
} Around;

static Around around(const float x, const float y, const int H, const int W)
{
    const int left = clamp((int)floor(x), 0, W - 1), upper = clamp((int)floor(y), 0, H - 1);
    const int right = min(left + 1, W - 1), lower = min(upper + 1, H - 1);
    const Around found = {
        upper * W + left, upper * W + right, lower * W + left, lower * W + right,
        clamp(x - (float)left, 0.0f, 1.0f), clamp(y - (float)upper, 0.0f, 1.0f)};
    return found;
}

static float between(
    const Around at, const float a, const float b, const float c, const float d)
{
    const float above = a * (1.0f - at.u) + b * at.u;
    const float below = c * (1.0f - at.u) + d * at.u;
    return above * (1.0f - at.v) + below * at.v;
}

static float part_at(__global const float *part, const Around at)
{
    return between(at, part[at.a], part[at.b], part[at.c], part[at.d]);
}

static int is_dark(__global const uchar *shadow, const int k, const int i)
{
    return shadow[i] >> k & 1;
}

static float darkness_at(__global const uchar *shadow, const int k, const Around at)
{
    return between(
        at, is_dark(shadow, k, at.a), is_dark(shadow, k, at.b), is_dark(shadow, k, at.c),
        is_dark(shadow, k, at.d));
}

// The pixel nearest to a point; NOTHING outside the frame.
static int nearest(const float x, const float y, const int H, const int W)
{
    const int column = convert_int(rint(x)), row = convert_int(rint(y));
    return column >= 0 && column < W && row >= 0 && row < H ? row * W + column : NOTHING;
}

// How far along a ray the shadow ends and the edge that casts it lies; no edge is negative.
static float2 march(
    __global const uchar *shadow, __global const float *part, const int k, const float column,
    const float row, const float ux, const float uy, const int H, const int W, const float step_,
    const float longest)
{
    float end = HALF, before = part_at(part, around(column, row, H, W));
    for (float t = step_; t <= longest; t += step_) {
        const float x = column + ux * t, y = row + uy * t;
        if (!(x >= 0.0f && x <= (float)(W - 1) && y >= 0.0f && y <= (float)(H - 1))) break;
        const Around at = around(x, y, H, W);
        if (t - step_ < FARTHEST_END) {
            const float now = part_at(part, at);
            if (now < HALF && before >= HALF) {
                const float back = step_ * (HALF - now) / fmax(before - now, 1e-6f);
                end = clamp(t - back, 0.0f, FARTHEST_END);
            }
            before = now;
        }
        if (t > NEAREST_EDGE && darkness_at(shadow, k, at) < HALF) return (float2)(end, t);
    }
    return (float2)(end, -1.0f);
}

// Whether an LED's shadow covers any of `count` pixels of a row, or a pixel beside them.
static int shadow_near(
    __global const uchar *shadow, const int k, const int row, const int column, const int count,
    const int H, const int W)
{
    ints labels = 0;
    for (int y = max(row - 1, 0); y <= min(row + 1, H - 1); ++y)
        for (int x = max(column - 1, 0); x <= min(column + 1, W - 1); ++x)
            labels |= load_bytes(shadow + y * W + x, min(count, W - x));
    return ANY((labels & (1 << k)) != 0);
}

// The edge whose shadow of LED k ends at a pixel, and how far it stands above.
static void measure_at(
    __global const uchar *shadow, __global const uchar *used, __global const float *slope,
    __global const float *height, __global const float *lights, __global const float *part,
    __global int *top, __global float *rise, const int k, const int row, const int column,
    const int H, const int W, const float pixel, const float step_, const float longest)
{
    const int i = row * W + column, size = H * W;
    if (is_dark(shadow, k, i) || popcount(used[i]) < 2) return;
    const float dx = lights[3 * k] / pixel + (float)(W - 1) / 2.0f - (float)column;
    const float dy = lights[3 * k + 1] / pixel + (float)(H - 1) / 2.0f - (float)row;
    const float plan = fmax(sqrt(dx * dx + dy * dy), 1e-6f);
    const float ux = dx / plan, uy = dy / plan;
    const int next = nearest((float)column + ux, (float)row + uy, H, W);
    if (next == NOTHING || !is_dark(shadow, k, next)) return;

    const float2 ends = march(
        shadow, part + k * size, k, (float)column, (float)row, ux, uy, H, W, step_, longest);
    if (ends.y < 0.0f) return;
    const float end = ends.x, beyond = ends.y + 0.25f;
    const float x = (float)column + ux * beyond, y = (float)row + uy * beyond;
    const int edge = nearest(x, y, H, W);
    if (edge == NOTHING || is_dark(shadow, k, edge) || popcount(used[edge]) < 2) return;

    const float downhill = slope[i] * ux + slope[size + i] * uy;
    const float to_end = pixel * end * clamp(downhill, -STEEPEST, STEEPEST);
    const float length_ =
        (rint(x) - (float)column) * ux + (rint(y) - (float)row) * uy - end;
    const float tangent =
        (lights[3 * k + 2] - (height[i] + to_end)) / ((plan - end) * pixel);
    top[k * size + i] = edge;
    rise[k * size + i] = length_ * pixel * tangent + to_end;
}

// For each LED and pixel: the edge whose shadow ends there, and how far it stands above.
__kernel void measure(
    __global const uchar *restrict shadow, __global const uchar *restrict used,
    __global const float *restrict slope, __global const float *restrict height,
    __global const float *restrict lights, __global const float *restrict part,
    __global int *restrict top, __global float *restrict rise, const int K, const int H,
    const int W, const float pixel, const float step_, const float longest)
{
    GRID_PARTS_OF_ROWS(line, x, count, K * H, W)
    const int k = line / H, row = line % H;
    for (int l = 0; l < count; ++l) top[line * W + x + l] = NOTHING;
    if (!shadow_near(shadow, k, row, x, count, H, W)) return;
    for (int l = 0; l < count; ++l)
        measure_at(
            shadow, used, slope, height, lights, part, top, rise, k, row, x + l, H, W, pixel,
            step_, longest);
}

__kernel void count_rows(
    __global const int *restrict top, __global int *restrict counts, const int rows, const int W)
{
    GRID_1(row, rows)
    int count = 0;
    for (int x = 0; x < W; ++x) count += top[row * W + x] != NOTHING;
    counts[row] = count;
}

// The measurements of a row of an LED, one after another from the place kept for them.
__kernel void gather_rows(
    __global const int *restrict top_of, __global const float *restrict rise_of,
    __global const int *restrict start, __global int *restrict top, __global int *restrict foot,
    __global float *restrict rise, __global uchar *restrict led, const int K, const int H,
    const int W)
{
    GRID_1(row, K * H)
    int at = start[row];
    for (int x = 0; x < W; ++x) {
        const int i = row * W + x;
        if (top_of[i] == NOTHING) continue;
        top[at] = top_of[i];
        foot[at] = row % H * W + x;
        rise[at] = rise_of[i];
        led[at] = row / H + 1;
        ++at;
    }
}
