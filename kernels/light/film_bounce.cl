#include "common.clh"
#include "lanes.clh"
#include "group.clh"
#include "near_light.clh"
#include "radiosity.clh"
#include "film.clh"
#include "coated_bounce.clh"

#define BLOCK 4
#define SPAN 16

// The first of the cells that block number j holds: of the rim, the cell at the frame is a block,
// those farther away another.
static int first_of(const int j, const int cells, const int rim)
{
    const int edge = min(rim, 2), blocks = (cells + BLOCK - 1) / BLOCK, beyond = j - edge - blocks;
    if (j < edge) return j == 0 ? 0 : rim - 1;
    if (beyond < 0) return rim + BLOCK * (j - edge);
    return rim + cells + (beyond == edge ? rim : min(beyond, 1));
}

// Cells of the frame and of its rim put together: mean place, whole area vector, mean light.
__kernel void put_together(
    __global const float *restrict table,
    __global float *restrict far,
    const int h, const int w, const int rim)
{
    const int edge = min(rim, 2), down = (h + BLOCK - 1) / BLOCK + 2 * edge;
    const int across = (w + BLOCK - 1) / BLOCK + 2 * edge, M = down * across;
    GRID_1(i, M)
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    const int top = first_of(i / across, h, rim), bottom = first_of(i / across + 1, h, rim);
    const int left = first_of(i % across, w, rim), right = first_of(i % across + 1, w, rim);
    float sums[6 + LEDS];
    for (int c = 0; c < 6 + LEDS; ++c) sums[c] = 0.0f;
    for (int y = top; y < bottom; ++y) {
        for (int x = left; x < right; ++x) {
            __global const float *cell = table + y * columns + x;
            const float area = cell[(CELL_AREA + 2) * N];
            for (int c = 0; c < 3; ++c) {
                sums[CELL_X + c] += cell[(CELL_X + c) * N] * area;
                sums[CELL_AREA + c] += cell[(CELL_AREA + c) * N];
            }
            for (int k = 0; k < LEDS; ++k) sums[CELL_LIGHT + k] += cell[(CELL_LIGHT + k) * N] * area;
        }
    }
    const float whole = sums[CELL_AREA + 2];
    for (int c = 0; c < 6 + LEDS; ++c) {
        const int is_area = c >= CELL_AREA && c < CELL_AREA + 3;
        far[c * M + i] = is_area ? sums[c] : sums[c] / whole;
    }
}

// LANES cells of a row: where they lie, their normals, and what arrives there.
typedef struct {
    floats x, y, z, nx, ny, nz, total[LEDS];
} Cells;

// What number j of a table of N sources throws on them.
static void add_source(Cells *on, __global const float *there, const int N)
{
    const floats none = 0.0f;
    const floats dx = there[0] - on->x, dy = there[N] - on->y, dz = there[2 * N] - on->z;
    const floats square = dx * dx + dy * dy + dz * dz + NEAREST;
    const floats arriving = on->nx * dx + on->ny * dy + on->nz * dz;
    const floats leaving = -(there[CELL_AREA * N] * dx + there[(CELL_AREA + 1) * N] * dy
                             + there[(CELL_AREA + 2) * N] * dz);
    const floats factor = MORE_OF(arriving, none) * MORE_OF(leaving, none) / (square * square);
    for (int k = 0; k < LEDS; ++k) on->total[k] += factor * there[(CELL_LIGHT + k) * N];
}

// The cells, and blocks of cells, that those in rows and columns from `top` and `left` on see.
typedef struct {
    int edge, down, across, top, bottom, left, right;
} Around;

static Around around(
    const int row, const int column, const int h, const int w, const int rim, const int near)
{
    const int down = (h + BLOCK - 1) / BLOCK, across = (w + BLOCK - 1) / BLOCK;
    const int span = column / SPAN * (SPAN / BLOCK);
    const Around a = {
        min(rim, 2), down, across,
        max(0, row / BLOCK - near), min(down, row / BLOCK + near + 1),
        max(0, span - near), min(across, span + SPAN / BLOCK + near)};
    return a;
}

// Calls `add(on, table, N)` for each cell nearby and each block farther away.
#define FOR_ALL_AROUND(a, on, table, N, far, h, w, rim, add)                                     \
    for (int y = BLOCK * a.top; y < min(BLOCK * a.bottom, h); ++y)                               \
        for (int x = BLOCK * a.left; x < min(BLOCK * a.right, w); ++x)                           \
            add(on, table + (y + rim) * (w + 2 * rim) + rim + x, N);                             \
    const int wide = a.across + 2 * a.edge, M = wide * (a.down + 2 * a.edge);                    \
    for (int j = 0; j < M; ++j) {                                                                \
        const int y = j / wide - a.edge, x = j % wide - a.edge;                                  \
        if (y < a.top || y >= a.bottom || x < a.left || x >= a.right) add(on, far + j, M);       \
    }

// What all cells throw on LANES cells of a row of the frame, those far away block by block.
LANED __kernel void near_and_far(
    __global const float *restrict table,
    __global const float *restrict far,
    __global float *restrict bounced,
    const int h, const int w, const int rim,
    const int near,
    const float gain)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    __global const float *here = table + (row + rim) * columns + rim + column;
    Cells on = {load_floats(here, count), load_floats(here + N, count),
                load_floats(here + 2 * N, count), load_floats(here + CELL_AREA * N, count),
                load_floats(here + (CELL_AREA + 1) * N, count),
                load_floats(here + (CELL_AREA + 2) * N, count)};
    const floats length_ = sqrt(on.nx * on.nx + on.ny * on.ny + on.nz * on.nz);
    on.nx /= length_;
    on.ny /= length_;
    on.nz /= length_;
    for (int k = 0; k < LEDS; ++k) on.total[k] = 0.0f;
    const Around a = around(row, column, h, w, rim, near);
    FOR_ALL_AROUND(a, &on, table, N, far, h, w, rim, add_source)
    for (int k = 0; k < LEDS; ++k) {
        const floats rest = load_floats(here + (CELL_REST + k) * N, count);
        store_floats(gain * on.total[k] / rest, bounced + (k * h + row) * w + column, count);
    }
}

// `near_and_far` of a film with a coat.
LANED __kernel void coated_near_and_far(
    __global const float *restrict table,
    __global const float *restrict sources,
    __global const float *restrict far,
    __global float *restrict bounced,
    __global const float *restrict lights, __global const float *restrict diffuse,
    const float base, const float roughness, const float refraction, const float camera,
    const int h, const int w, const int rim,
    const int near,
    const float gain)
{
    GRID_PARTS_OF_ROWS(row, column, count, h, w)
    const Film film = COATED_FILM;
    const int columns = w + 2 * rim, N = columns * (h + 2 * rim);
    const int at = (row + rim) * columns + rim + column;
    CoatedCells on = coated_cells(&film, sources + at, N, count);
    const Around a = around(row, column, h, w, rim, near);
    FOR_ALL_AROUND(a, &on, sources, N, far, h, w, rim, add_coated_source)
    throw_back(&on, table + at, N, bounced + row * w + column, h * w, gain, count);
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
    floats found = between_cells(bounced, k, y, x, count, factor, h, w);
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
