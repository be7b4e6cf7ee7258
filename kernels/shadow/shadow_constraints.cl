// Equation C1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "bilinear.clh"
#include "rays.clh"

#define HALF_LIGHT 0.5f
#define MIN_EXPECTED_LIGHT 0.02f
#define MAX_SLOPE 3.0f
#define MAX_END_PX 1.5f
#define MIN_EDGE_PX 1.2f
#define MAX_LEDS 8
// The light that determines a shadow's end lies within this many pixels of it.
#define AROUND_END 4

// Any of the labels of `count` pixels.
static int any_of(__global const uchar *labels, const int count)
{
#if LANES > 1
    if (count == LANES) {
        const uint4 four = as_uint4(LOAD_LANES(labels));
        const uint any = four.x | four.y | four.z | four.w;
        return (any | any >> 8 | any >> 16 | any >> 24) & 0xff;
    }
#endif
    int result = 0;
    for (int l = 0; l < count; ++l) result |= labels[l];
    return result;
}

// The LEDs whose shadow may cover any of `count` pixels of a row, or a pixel `reach` away from
// them.
static int shadows_near(
    __global const uchar *shadow, const int row, const int column, const int count,
    const int reach, const int H, const int W)
{
    const int end = min(column + count + reach, W), last = max(W - LANES, 0);
    int result = 0;
    for (int y = max(row - reach, 0); y <= min(row + reach, H - 1); ++y)
        for (int x = max(column - reach, 0); x < end; x += LANES)
            result |= any_of(shadow + y * W + min(x, last), min(LANES, W));
    return result;
}

// The share (0 to 1) of its direct light that each pixel near an LED's shadow gets from the LED.
__kernel void lit_part(
    __global const float *restrict light, __global const float *restrict bounced,
    __global const float *restrict slope, __global const float *restrict height,
    __global const float *restrict lights, __global const float *restrict diffuse,
    __global const uchar *restrict shadow, __global float *restrict part, const int K,
    const int H, const int W, const float pixel)
{
    const int size = H * W;
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int near = shadows_near(shadow, row, column, count, AROUND_END, H, W);
    if (!near) return;
    const int i = row * W + column;
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats steep = sqrt(1.0f + p * p + q * q), nothing = 0.0f, all = 1.0f;
    const floats z = load_floats(height + i, count), faintest = MIN_EXPECTED_LIGHT;
    floats x, y;
    places(i, H, W, pixel, &x, &y);
    for (int k = 0; k < K; ++k) {
        if (!(near >> k & 1)) continue;
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats matt = (v.z - p * v.x - q * v.y) / steep;
        floats direct = load_floats(light + k * size + i, count) - diffuse[k];
        if (bounced) direct -= load_floats(bounced + k * size + i, count);
        const floats share = direct / ((1.0f - diffuse[k]) * MORE_OF(matt, faintest));
        const floats some = MORE_OF(share, nothing);
        store_floats(LESS_OF(some, all), part + k * size + i, count);
    }
}

static int are_dark(__global const uchar *shadow, const int k, const Around at)
{
    return (shadow[at.a] & shadow[at.b] & shadow[at.c] & shadow[at.d]) >> k & 1;
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

// The distances along a ray of the shadow's end and its casting edge; negative if there is no edge.
static float2 march(
    __global const uchar *shadow, __global const float *part, const int k, const Ray ray,
    const int H, const int W, const float step_, const float longest)
{
    float end = HALF_LIGHT, before = bilinear(part, around(ray.column, ray.row, H, W));
    for (float t = step_; t <= longest; t += step_) {
        const float2 p = point_at(ray, t);
        if (!(p.x >= 0.0f && p.x <= (float)(W - 1) && p.y >= 0.0f && p.y <= (float)(H - 1))) break;
        const Around at = around(p.x, p.y, H, W);
        if (t - step_ < MAX_END_PX) {
            const float now = bilinear(part, at);
            if (now < HALF_LIGHT && before >= HALF_LIGHT) {
                const float back = step_ * (HALF_LIGHT - now) / fmax(before - now, 1e-6f);
                end = clamp(t - back, 0.0f, MAX_END_PX);
            }
            before = now;
        }
        if (t <= MIN_EDGE_PX || are_dark(shadow, k, at)) continue;
        if (darkness_at(shadow, k, at) < HALF_LIGHT) return (float2)(end, t);
    }
    return (float2)(end, -1.0f);
}

// The measurements from the shadows of an LED, one after another.
typedef struct {
    __global int *top, *foot;
    __global float *rise;
} Measured;

// The edge whose shadow of LED k ends at a pixel, and its rise above it; returns their number.
static int measure_at(
    __global const uchar *shadow, __global const uchar *used, __global const float *slope,
    __global const float *height, __global const float *lights, __global const float *part,
    const Measured to, const int at, const int k, const int row, const int column, const int H,
    const int W, const float pixel, const float step_, const float longest)
{
    const int i = row * W + column, size = H * W;
    if (is_dark(shadow, k, i) || popcount(used[i]) < 2) return 0;
    const Ray ray = ray_towards(lights + 3 * k, row, column, H, W, pixel);
    const int next = nearest(point_at(ray, 1.0f), H, W);
    if (next == NO_PIXEL || !is_dark(shadow, k, next)) return 0;

    const float2 ends = march(shadow, part + k * size, k, ray, H, W, step_, longest);
    if (ends.y < 0.0f) return 0;
    const float end = ends.x;
    const float2 top = point_at(ray, ends.y + 0.25f);
    const int edge = nearest(top, H, W);
    if (edge == NO_PIXEL || is_dark(shadow, k, edge) || popcount(used[edge]) < 2) return 0;

    const float downhill = slope[i] * ray.ux + slope[size + i] * ray.uy;
    const float to_end = pixel * end * clamp(downhill, -MAX_SLOPE, MAX_SLOPE);
    const float length_ =
        (rint(top.x) - ray.column) * ray.ux + (rint(top.y) - ray.row) * ray.uy - end;
    const float tangent =
        (lights[3 * k + 2] - (height[i] + to_end)) / ((ray.plan - end) * pixel);
    to.top[at] = edge;
    to.foot[at] = i;
    to.rise[at] = length_ * pixel * tangent + to_end;
    return 1;
}

// For each LED and span of a row: the measurements from the shadows that end there, one after
// another from the span's first pixel on, and their number.
__kernel void measure(
    __global const uchar *restrict shadow, __global const uchar *restrict used,
    __global const float *restrict slope, __global const float *restrict height,
    __global const float *restrict lights, __global const float *restrict part,
    __global int *restrict top, __global int *restrict foot, __global float *restrict rise,
    __global int *restrict counts, const int K, const int H, const int W, const int span,
    const float pixel, const float step_, const float longest)
{
    const int across = (W + span - 1) / span;
    GRID_1(n, H * across)
    const int row = n / across, start = span * (n - row * across), end = min(start + span, W);
    const Measured to = {top, foot, rise};
    int result[MAX_LEDS];
    for (int k = 0; k < K; ++k) result[k] = 0;
    for (int x = start; x < end; x += LANES) {
        const int count = min(LANES, end - x);
        const int near = shadows_near(shadow, row, x, count, 1, H, W);
        for (int k = 0; near && k < K; ++k)
            for (int l = 0; l < (near >> k & 1 ? count : 0); ++l)
                result[k] += measure_at(
                    shadow, used, slope, height, lights, part, to,
                    (k * H + row) * W + start + result[k], k, row, x + l, H, W, pixel, step_,
                    longest);
    }
    for (int k = 0; k < K; ++k) counts[k * H * across + n] = result[k];
}

// The measurements of all spans without gaps, from the film at rest; those of a span end at `ends`.
__kernel void gather_spans(
    __global const int *restrict top_of, __global const int *restrict foot_of,
    __global const float *restrict rise_of, __global const int *restrict counts,
    __global const int *restrict ends, __global const float *restrict rest,
    __global int *restrict top, __global int *restrict foot, __global float *restrict rise,
    __global uchar *restrict led, const int K, const int H, const int W, const int span)
{
    const int across = (W + span - 1) / span;
    GRID_1(n, K * H * across)
    const int line = n / across, from = line * W + span * (n - line * across);
    const int count = counts[n], at = ends[n] - count;
    for (int c = 0; c < count; ++c) {
        top[at + c] = top_of[from + c];
        foot[at + c] = foot_of[from + c];
        rise[at + c] = rise_of[from + c];
        if (rest) rise[at + c] -= rest[top[at + c]] - rest[foot[at + c]];
        led[at + c] = line / H + 1;
    }
}
