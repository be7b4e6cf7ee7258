#include "common.clh"
#include "lanes.clh"

#define GROUP 64

// The largest height, by one work-group.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void highest(
    __global const float *restrict height,
    __global float *restrict top,
    const int size)
{
    __local float tops[GROUP];
    const int me = get_local_id(0);
    float found = height[0];
    for (int i = me; i < size; i += GROUP) found = fmax(found, height[i]);
    tops[me] = found;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (me == 0) {
        for (int i = 1; i < GROUP; ++i) found = fmax(found, tops[i]);
        top[0] = found;
    }
}

static float bilinear(
    __global const float *plane, const int H, const int W, const float x, const float y)
{
    const int left = clamp((int)floor(x), 0, W - 1), upper = clamp((int)floor(y), 0, H - 1);
    const int right = min(left + 1, W - 1), lower = min(upper + 1, H - 1);
    const float u = clamp(x - (float)left, 0.0f, 1.0f), v = clamp(y - (float)upper, 0.0f, 1.0f);
    const float above = plane[upper * W + left] * (1.0f - u) + plane[upper * W + right] * u;
    const float below = plane[lower * W + left] * (1.0f - u) + plane[lower * W + right] * u;
    return above * (1.0f - v) + below * v;
}

// Whether the surface rises above the ray from a pixel to an LED.
static int is_blocked(
    __global const float *height,
    __global const float *led,
    const float top, const float pixel,
    const int H, const int W, const int row, const int column)
{
    const float x = (float)column, y = (float)row, z = height[row * W + column];
    const float dx = led[0] / pixel - (x - 0.5f * (W - 1));
    const float dy = led[1] / pixel - (y - 0.5f * (H - 1));
    const float plan = sqrt(dx * dx + dy * dy) + 1e-6f;
    const float ux = dx / plan, uy = dy / plan, climb = (led[2] - z) / plan;
    float ray = z;
    for (float t = 0.5f; t < H + W && (ray < top || t == 0.5f); t += 0.5f) {
        const float px = x + ux * t, py = y + uy * t;
        if (px < 0.0f || px > W - 1 || py < 0.0f || py > H - 1) return 0;
        ray = z + climb * t;
        if (bilinear(height, H, W, px, py) > ray) return 1;
    }
    return 0;
}

static int is_seen(
    __global const uchar *seen,
    const int k, const int reach, const int H, const int W, const int row, const int column)
{
    for (int y = max(row - reach, 0); y <= min(row + reach, H - 1); ++y)
        for (int x = max(column - reach, 0); x <= min(column + reach, W - 1); ++x)
            if (seen[y * W + x] >> k & 1) return 1;
    return 0;
}

// The LEDs whose shadow the image shows at `count` pixels of a row, or near by.
static ints seen_near(
    __global const uchar *seen, const int reach, const int H, const int W, const int row,
    const int column, const int count)
{
    ints labels = 0;
    const int last = min(column + count + reach, W);
    for (int y = max(row - reach, 0); y <= min(row + reach, H - 1); ++y)
        for (int x = max(column - reach, 0); x < last; x += LANES)
            labels |= load_bytes(seen + y * W + x, min(LANES, last - x));
    return labels;
}

// Labels: shadows that the height casts, and that the image shows near by.
__kernel void cast(
    __global const float *height,
    __global const float *lights,
    __global const uchar *seen,
    __global const float *top,
    __global uchar *out,
    const int H, const int W, const int K,
    const int ask_image,
    const int reach_px,
    const float pixel)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    uchar labels[LANES];
    for (int l = 0; l < LANES; ++l) labels[l] = 0;
    const ints near = ask_image ? seen_near(seen, reach_px, H, W, y, x, count) : (ints)255;
    for (int k = 0; k < K; ++k) {
        if (!ANY((near & (1 << k)) != 0)) continue;
        for (int l = 0; l < count; ++l) {
            if (ask_image && !is_seen(seen, k, reach_px, H, W, y, x + l)) continue;
            if (is_blocked(height, lights + 3 * k, top[0], pixel, H, W, y, x + l))
                labels[l] |= 1 << k;
        }
    }
    for (int l = 0; l < count; ++l) out[y * W + x + l] = labels[l];
}
