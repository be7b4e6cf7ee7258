#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define GROUP_ITEMS 64

// The largest height, by one work-group.
__kernel __attribute__((reqd_work_group_size(GROUP_ITEMS, 1, 1)))
void highest(
    __global const float *restrict height,
    __global float *restrict top,
    const int size)
{
    __local float tops[GROUP_ITEMS];
    const int me = get_local_id(0);
    float found = height[0];
    for (int i = me; i < size; i += GROUP_ITEMS) found = fmax(found, height[i]);
    tops[me] = found;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (me == 0) {
        for (int i = 1; i < GROUP_ITEMS; ++i) found = fmax(found, tops[i]);
        top[0] = found;
    }
}

#define BLOCK_PX 16

// The largest height of each block of pixels and of those that begin the next blocks, so that no
// interpolated height in the block is larger.
__kernel void block_tops(
    __global const float *restrict height,
    __global float *restrict tops,
    const int H, const int W, const int rows, const int columns)
{
    GRID_2(row, column, rows, columns)
    float found = -INFINITY;
    for (int y = row * BLOCK_PX; y <= min((row + 1) * BLOCK_PX, H - 1); ++y)
        for (int x = column * BLOCK_PX; x <= min((column + 1) * BLOCK_PX, W - 1); ++x)
            found = fmax(found, height[y * W + x]);
    tops[row * columns + column] = found;
}

// How far along a line a ray that begins at `at` and goes `u` per step stays in block `block`.
static float way_out(const float at, const float u, const int block)
{
    if (u > 0.0f) return ((float)((block + 1) * BLOCK_PX) - at) / u;
    return u < 0.0f ? ((float)(block * BLOCK_PX) - at) / u : INFINITY;
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

// Whether the surface rises above the ray from a pixel to an LED.  A ray that climbs passes over
// blocks whose top is lower.
static int is_blocked(
    __global const float *height,
    __global const float *tops,
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
    for (float t = 0.5f; t < H + W && (ray < top || t == 0.5f);) {
        const float px = x + ux * t, py = y + uy * t;
        if (px < 0.0f || px > W - 1 || py < 0.0f || py > H - 1) return 0;
        ray = z + climb * t;
        const int across = (int)px / BLOCK_PX, along = (int)py / BLOCK_PX;
        if (tops[along * ((W + BLOCK_PX - 1) / BLOCK_PX) + across] > ray) {
            if (bilinear(height, H, W, px, py) > ray) return 1;
        } else if (climb >= 0.0f) {
            const float way = fmin(way_out(x, ux, across), way_out(y, uy, along));
            t = fmax(t, 0.5f * floor(2.0f * way) - 0.5f);
        }
        t += 0.5f;
    }
    return 0;
}

// The LEDs whose shadow the image shows at a pixel, or `reach` pixels away along one axis (1: x).
LANED __kernel void spread_labels(
    __global const uchar *restrict seen,
    __global uchar *restrict near,
    const int H, const int W, const int reach, const int axis)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    ints labels = 0;
    for (int d = -reach; d <= reach; ++d) {
        const int row = axis ? y : clamp(y + d, 0, H - 1), column = axis ? x + d : x;
        labels |= load_bytes_within_border(seen + row * W, column, count, W, REPLICATE);
    }
    store_bytes(labels, near + y * W + x, count);
}

// Labels: shadows that the height casts and the image shows near by.
__kernel void cast(
    __global const float *height,
    __global const float *lights,
    __global const uchar *near,
    __global const float *top,
    __global const float *tops,
    __global uchar *out,
    const int H, const int W, const int K,
    const float pixel)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    for (int l = 0; l < count; ++l) {
        const int asked = near ? near[y * W + x + l] : 255;
        uchar labels = 0;
        for (int k = 0; k < K; ++k) {
            if (!(asked >> k & 1)) continue;
            if (is_blocked(height, tops, lights + 3 * k, top[0], pixel, H, W, y, x + l))
                labels |= 1 << k;
        }
        out[y * W + x + l] = labels;
    }
}
