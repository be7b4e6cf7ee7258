#include "common.clh"
#include "lanes.clh"
#include "group.clh"

#define NEAREST 1e-12f

// A table of N cells: x, y, z of the middle, area vector, light that falls on it under each LED,
// and that on the film at rest.
#define CELL_X 0
#define CELL_AREA 3
#define CELL_LIGHT 6
#define CELL_REST (CELL_LIGHT + LEDS)

// The j-th cell along an axis of `count` pixels, `rim` cells at both ends: its first pixel, how
// many it has (none in the rim), its middle and its width in mm.
typedef struct {
    int first, pixels;
    float middle, width;
} Side;

static Side side(
    const int j, const int count, const int cells, const int rim, const int factor,
    const float pixel, const float rim_mm)
{
    const float half_ = 0.5f * (float)count;
    Side s = {(j - rim) * factor, 0, 0.0f, rim_mm};
    if (j < rim) {
        s.middle = -(half_ * pixel + ((float)(rim - 1 - j) + 0.5f) * rim_mm);
    } else if (j >= rim + cells) {
        s.middle = half_ * pixel + ((float)(j - rim - cells) + 0.5f) * rim_mm;
    } else {
        s.pixels = min(factor, count - s.first);
        s.middle = ((float)s.first + 0.5f * (float)s.pixels - half_) * pixel;
        s.width = (float)s.pixels * pixel;
    }
    return s;
}

static float mean_of(__global const float *plane, const Side across, const Side down, const int W)
{
    float total = 0.0f;
    for (int y = down.first; y < down.first + down.pixels; ++y) {
        float sum = 0.0f;
        for (int x = across.first; x < across.first + across.pixels; ++x) sum += plane[y * W + x];
        total += sum;
    }
    return total / (float)(across.pixels * down.pixels);
}

// Mean of the central differences over the pixels of a cell, one-sided at the frame's border.
static float mean_slope(
    __global const float *height, const Side across, const Side down, const int H, const int W,
    const int along_x)
{
    float total = 0.0f;
    for (int y = down.first; y < down.first + down.pixels; ++y) {
        float sum = 0.0f;
        for (int x = across.first; x < across.first + across.pixels; ++x) {
            const int here = along_x ? x : y, last = along_x ? W - 1 : H - 1;
            const int before = max(here - 1, 0), after = min(here + 1, last);
            const float rise = along_x ? height[y * W + after] - height[y * W + before]
                                       : height[after * W + x] - height[before * W + x];
            sum += rise / (float)max(after - before, 1);
        }
        total += sum;
    }
    return total / (float)(across.pixels * down.pixels);
}

// The cells of the frame and of the rim around it.
__kernel void lay_out(
    __global const float *restrict light,
    __global const float *restrict height,
    __global const float *restrict lights,
    const float pixel,
    __global float *restrict table,
    const int H, const int W,
    const int factor,
    const int h, const int w, const int rim,
    const float rim_mm)
{
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    GRID_1(i, N)
    const int row = i / columns;
    const Side across = side(i - row * columns, W, w, rim, factor, pixel, rim_mm);
    const Side down = side(row, H, h, rim, factor, pixel, rim_mm);
    const int framed = across.pixels > 0 && down.pixels > 0;
    const float area = down.width * across.width;
    __global float *cell = table + i;
    float z = 0.0f, p = 0.0f, q = 0.0f;
    if (framed) {
        z = mean_of(height, across, down, W);
        p = mean_slope(height, across, down, H, W, 1) / pixel;
        q = mean_slope(height, across, down, H, W, 0) / pixel;
    }
    cell[CELL_X * N] = across.middle;
    cell[(CELL_X + 1) * N] = down.middle;
    cell[(CELL_X + 2) * N] = z;
    cell[CELL_AREA * N] = -p * area;
    cell[(CELL_AREA + 1) * N] = -q * area;
    cell[(CELL_AREA + 2) * N] = area;
    for (int k = 0; k < LEDS; ++k) {
        __global const float *led = lights + 3 * k;
        const float dx = led[0] - across.middle, dy = led[1] - down.middle;
        const float nearer = led[2] * led[2] / (dx * dx + dy * dy + led[2] * led[2]);
        const float rest = nearer * sqrt(nearer);
        const float seen = framed ? mean_of(light + k * H * W, across, down, W) : 1.0f;
        cell[(CELL_LIGHT + k) * N] = rest * seen;
        cell[(CELL_REST + k) * N] = rest;
    }
}

// What all cells throw on LANES cells of a row of the frame.
LANED __kernel void bounce(
    __global const float *restrict table,
    __global float *restrict bounced,
    const int h, const int w, const int rim,
    const float gain)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    __global const float *here = table + (row + rim) * columns + rim + column;
    const floats none = 0.0f;
    const floats px = load_floats(here, count), py = load_floats(here + N, count);
    const floats pz = load_floats(here + 2 * N, count);
    floats nx = load_floats(here + CELL_AREA * N, count);
    floats ny = load_floats(here + (CELL_AREA + 1) * N, count);
    floats nz = load_floats(here + (CELL_AREA + 2) * N, count);
    const floats length_ = sqrt(nx * nx + ny * ny + nz * nz);
    nx /= length_;
    ny /= length_;
    nz /= length_;
    floats total[LEDS];
    for (int k = 0; k < LEDS; ++k) total[k] = 0.0f;
    for (int j = 0; j < N; ++j) {
        __global const float *there = table + j;
        const floats dx = there[0] - px, dy = there[N] - py, dz = there[2 * N] - pz;
        const floats square = dx * dx + dy * dy + dz * dz + NEAREST;
        const floats arriving = nx * dx + ny * dy + nz * dz;
        const floats leaving = -(there[CELL_AREA * N] * dx + there[(CELL_AREA + 1) * N] * dy
                                 + there[(CELL_AREA + 2) * N] * dz);
        const floats factor =
            MORE_OF(arriving, none) * MORE_OF(leaving, none) / (square * square);
        for (int k = 0; k < LEDS; ++k) total[k] += factor * there[(CELL_LIGHT + k) * N];
    }
    for (int k = 0; k < LEDS; ++k) {
        const floats rest = load_floats(here + (CELL_REST + k) * N, count);
        store_floats(gain * total[k] / rest, bounced + (k * h + row) * w + column, count);
    }
}

// Where between the middles of two cells a pixel lies.
static float place_of(const int at, const int cells, const int factor)
{
    return clamp(((float)at + 0.5f) / (float)factor - 0.5f, 0.0f, (float)(cells - 1));
}

// The light of cells brought to pixels, and no further from the one before than `share`.
LANED __kernel void interpolate(
    __global const float *restrict bounced,
    __global const float *restrict before,
    __global float *restrict out,
    const int H, const int W,
    const int factor,
    const int h, const int w,
    const float share)
{
    GRID_PARTS_OF_ROWS(line, x, count, LEDS * H, W)
    const int k = line / H, y = line - k * H;
    const float row = place_of(y, h, factor);
    const int above = (int)row, below = min(above + 1, h - 1);
    __global const float *upper = bounced + (k * h + above) * w;
    __global const float *lower = bounced + (k * h + below) * w;
    float part[LANES];
    int left[LANES], right[LANES];
    for (int l = 0; l < LANES; ++l) {
        const float column = place_of(x + min(l, count - 1), w, factor);
        left[l] = (int)column;
        right[l] = min(left[l] + 1, w - 1);
        part[l] = column - (float)left[l];
    }
    const floats across = LOAD_LANES(part), down = row - (float)above;
    const floats a = gather_floats(upper, left), b = gather_floats(lower, left);
    const floats top = a + (gather_floats(upper, right) - a) * across;
    const floats bottom = b + (gather_floats(lower, right) - b) * across;
    floats found = factor == 1 ? a : top + (bottom - top) * down;
    const int i = line * W + x;
    if (before) {
        const floats earlier = load_floats(before + i, count);
        found = earlier + share * (found - earlier);
    }
    store_floats(found, out + i, count);
}

// A film that reflects nothing.
LANED __kernel void nothing(__global float *restrict out, const int N)
{
    GRID_LANES(i, count, N)
    const floats none = 0.0f;
    store_floats(none, out + i, count);
}
