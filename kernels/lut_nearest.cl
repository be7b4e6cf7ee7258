#include "common.clh"
#ifndef LIGHTS
#define LIGHTS 4
#endif
#include "lanes.clh"
#include "table_tree.clh"

// A work-item does one tile.  Where there are lanes to fill, its pixels are sorted by their
// light, so that the pixels of one packet walk the tree together.
#define TILE (LANES == 1 ? 1 : 32)
#define PIXELS (TILE * TILE)
#define PADDED (PIXELS + LANES)
#define CELLS 16
#define MOST_NEIGHBOURS 16
#define MOST_LIGHT 1e15f

// The entries nearest to a packet of pixels: of equally near ones the first in the table.
typedef struct {
    floats square;
    ints number, leaf;
} Nearest;

static void scan_leaf(
    Nearest *nearest, const floats *light, const Table *table, const int leaf)
{
    __global const float *entry = table->entries + leaf * LEAF * LIGHTS;
    floats square[LEAF];
    #pragma unroll
    for (int e = 0; e < LEAF; ++e) {
        square[e] = (floats)(0.0f);
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k) {
            const floats away = entry[e * LIGHTS + k] - light[k];
            square[e] += away * away;
        }
    }
    floats least = square[0];
    #pragma unroll
    for (int e = 1; e < LEAF; ++e) least = LESS_OF(square[e], least);
    if (!ANY(least <= nearest->square)) return;
    __global const int *numbers = table->numbers + leaf * LEAF;
    ints number = (ints)(INT_MAX);
    #pragma unroll
    for (int e = 0; e < LEAF; ++e) {
        const ints here = (ints)(numbers[e]);
        number = (square[e] == least) & (here < number) ? here : number;
    }
    const ints closer = (least < nearest->square)
        | ((least == nearest->square) & (number < nearest->number));
    nearest->square = closer ? least : nearest->square;
    nearest->number = closer ? number : nearest->number;
    nearest->leaf = closer ? (ints)(leaf) : nearest->leaf;
}

// Walk the three levels, from two leaves that are likely to be near.
static void walk(
    Nearest *nearest, const floats *light, const floats *point, const float *low,
    const float *high, const Table *table, const int first, const int second)
{
    scan_leaf(nearest, light, table, first);
    if (second != first) scan_leaf(nearest, light, table, second);
    float reach = highest_lane(nearest->square);
    for (int group = 0; group < table->groups; ++group) {
        __global const float *tops = boxes_of_tops(table, group);
        for (Boxes near_tops = within(gaps(low, high, tops), reach); near_tops;) {
            const int t = take(&near_tops);
            if (!ANY(gap(point, tops, t) <= nearest->square)) continue;
            const int top = 16 * group + t;
            __global const float *middles = boxes_of_middles(table, top);
            for (Boxes near = within(gaps(low, high, middles), reach); near;) {
                const int m = take(&near);
                if (!ANY(gap(point, middles, m) <= nearest->square)) continue;
                const int middle = 16 * top + m;
                __global const float *leaves = boxes_of_leaves(table, middle);
                Boxes near_leaves = within(gaps(low, high, leaves), reach);
                while (near_leaves) {
                    const int l = take(&near_leaves), leaf = 16 * middle + l;
                    if (leaf != first && leaf != second
                        && ANY(gap(point, leaves, l) <= nearest->square))
                        scan_leaf(nearest, light, table, leaf);
                }
                reach = highest_lane(nearest->square);
            }
        }
    }
}

// Light as the search takes it: NaN counts as dark, and squares stay finite.
static float tame(const float light)
{
    return light == light ? clamp(light, -MOST_LIGHT, MOST_LIGHT) : 0.0f;
}

// 0 for lit pixels, else the number of the darkest LED among the shadowed ones.
static int table_of(
    __global const float *light, const int shadow, const int pixel, const int size)
{
    int table = 0;
    float least = INFINITY;
    for (int k = 0; shadow >> k && k < LIGHTS; ++k) {
        const float value = tame(light[k * size + pixel]);
        if ((shadow >> k & 1) && value < least) {
            least = value;
            table = k + 1;
        }
    }
    return table;
}

// Place of every pixel among CELLS x CELLS cells of the tile's own extent along the two main
// axes, row by row, to and fro.
static void find_cells(
    ushort *cell, float light[LIGHTS][PADDED], const int count, __global const float *axes)
{
    float along[2][PADDED], lowest[2], scale[2];
    for (int axis = 0; axis < 2; ++axis) {
        floats low = (floats)(FLT_MAX), high = (floats)(-FLT_MAX);
        for (int i = 0; i < count; i += LANES) {
            floats place = (floats)(0.0f);
            for (int k = 0; k < LIGHTS; ++k)
                place = mad((floats)(axes[axis * LIGHTS + k]), LOAD_LANES(light[k] + i), place);
            STORE_LANES(place, along[axis] + i);
            low = LESS_OF(place, low);
            high = MORE_OF(place, high);
        }
        lowest[axis] = lowest_lane(low);
        scale[axis] = (CELLS - 0.01f) / fmax(highest_lane(high) - lowest[axis], 1e-20f);
    }
    for (int i = 0; i < count; ++i) {
        const int row = clamp((int)((along[0][i] - lowest[0]) * scale[0]), 0, CELLS - 1);
        const int column = clamp((int)((along[1][i] - lowest[1]) * scale[1]), 0, CELLS - 1);
        cell[i] = CELLS * row + (row & 1 ? CELLS - 1 - column : column);
    }
}

// Counting sort of the pixels by their cell.
static void sort_pixels(
    ushort *order, float light[LIGHTS][PADDED], const int count, __global const float *axes)
{
    ushort cell[PIXELS], start[CELLS * CELLS + 1];
    find_cells(cell, light, count, axes);
    for (int c = 0; c <= CELLS * CELLS; ++c) start[c] = 0;
    for (int i = 0; i < count; ++i) ++start[cell[i] + 1];
    for (int c = 0; c < CELLS * CELLS; ++c) start[c + 1] += start[c];
    for (int i = 0; i < count; ++i) order[start[cell[i]]++] = i;
}

static Table read_table(
    const int number, __global const float *entries, __global const int *numbers,
    __global const float *boxes, __global const float *axes, __global const float *centres,
    __global const int *tables)
{
    __global const int *record = tables + 4 * number;
    Table table;
    table.tops = record[0];
    table.groups = (record[0] + 15) / 16;
    table.boxes = boxes + 32 * LIGHTS * record[1];
    table.axes = axes + LIGHTS * LIGHTS * number;
    table.centre = centres + LIGHTS * number;
    table.entries = entries + LIGHTS * record[2];
    table.numbers = numbers + record[2];
    return table;
}

// The light of a packet along the table's axes, and the box around it.
static void find_point(
    floats *point, float *low, float *high, const floats *light, const Table *table)
{
    #pragma unroll
    for (int j = 0; j < LIGHTS; ++j) {
        point[j] = (floats)(-table->centre[j]);
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k)
            point[j] = mad((floats)(table->axes[j * LIGHTS + k]), light[k], point[j]);
        low[j] = lowest_lane(point[j]);
        high[j] = highest_lane(point[j]);
    }
}

// Find the entries of `count` pixels; the leaves of one packet are where the next one starts.
static void search(
    int *found, float light[LIGHTS][PADDED], const ushort *order, const int count,
    const Table *table)
{
    int leaves[LANES], begun = 0;
    for (int i = 0; i < count; i += LANES) {
        floats here[LIGHTS], point[LIGHTS];
        float low[LIGHTS], high[LIGHTS];
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k) {
            float gathered[LANES];
            for (int l = 0; l < LANES; ++l) gathered[l] = light[k][order[i + l]];
            here[k] = LOAD_LANES(gathered);
        }
        find_point(point, low, high, here, table);
        if (!begun) leaves[LANES - 1] = leaves[LANES / 2] = descend(table, low, high);
        begun = 1;
        Nearest nearest = {(floats)(FLT_MAX), (ints)(INT_MAX), (ints)(0)};
        walk(
            &nearest, here, point, low, high, table, leaves[LANES - 1], leaves[LANES / 2]);
        STORE_LANES(nearest.leaf, leaves);
        STORE_LANES(nearest.number, found + i);
    }
}

// The slope of the entry nearest in light, tile by tile and table by table.
__kernel
#if LANES > 1
__attribute__((reqd_work_group_size(1, 1, 1)))
#endif
void lut_nearest(
    __global const float *restrict light,
    __global const uchar *restrict shadow,
    __global const float *restrict entries,
    __global const int *restrict numbers,
    __global const float *restrict slopes,
    __global const float *restrict boxes,
    __global const float *restrict axes,
    __global const float *restrict centres,
    __global const int *restrict tables,
    __global float *restrict out,
    const int H, const int W)
{
    const int left = TILE * get_global_id(0), top = TILE * get_global_id(1);
    const int width = min(TILE, W - left), height = min(TILE, H - top), size = H * W;
    if (width <= 0 || height <= 0) return;
    uchar wanted[PIXELS];
    uint present = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int pixel = (top + y) * W + left + x;
            const int table = table_of(light, shadow[pixel], pixel, size);
            wanted[y * TILE + x] = table;
            present |= 1u << table;
        }
    for (int t = 0; t <= LIGHTS; ++t) {
        if (!(present >> t & 1)) continue;
        const Table table
            = read_table(t, entries, numbers, boxes, axes, centres, tables);
        __global const float *slope = slopes + 2 * tables[4 * t + 3];
        int pixels[PIXELS + 1], found[PADDED], count = 0;
        float value[LIGHTS][PADDED];
        ushort order[PADDED];
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                pixels[count] = (top + y) * W + left + x;
                count += wanted[y * TILE + x] == t;
            }
        for (int k = 0; k < LIGHTS; ++k)
            for (int i = 0; i < count; ++i)
                value[k][i] = k == t - 1 ? 0.0f : tame(light[k * size + pixels[i]]);
        if (table.tops == 0) {
            for (int i = 0; i < count; ++i) out[pixels[i]] = out[size + pixels[i]] = 0.0f;
            continue;
        }
        // The last packet is filled up with its last pixel.
        for (int i = count; i < count + LANES; ++i)
            for (int k = 0; k < LIGHTS; ++k) value[k][i] = value[k][count - 1];
        if (LANES > 1) sort_pixels(order, value, count, table.axes);
        else order[0] = 0;
        for (int i = count; i < count + LANES; ++i) order[i] = order[count - 1];
        search(found, value, order, count, &table);
        for (int i = 0; i < count; ++i) {
            const int pixel = pixels[order[i]];
            out[pixel] = slope[2 * found[i]];
            out[size + pixel] = slope[2 * found[i] + 1];
        }
    }
}

// The several nearest entries, nearest first; of equally near ones the first in the table.
typedef struct {
    int wanted, found;
    float square[MOST_NEIGHBOURS];
    int number[MOST_NEIGHBOURS];
} Several;

static int comes_before(
    const float square, const int number, const float other_square, const int other)
{
    return square < other_square || (square == other_square && number < other);
}

static void enter(Several *several, const float square, const int number)
{
    // Leaves are filled up with entries that stand elsewhere too.
    for (int i = 0; i < several->found; ++i)
        if (several->number[i] == number) return;
    int place = several->found;
    if (place == several->wanted) {
        --place;
        if (!comes_before(square, number, several->square[place], several->number[place])) return;
    } else {
        ++several->found;
    }
    for (; place > 0; --place) {
        const float before = several->square[place - 1];
        if (!comes_before(square, number, before, several->number[place - 1])) break;
        several->square[place] = before;
        several->number[place] = several->number[place - 1];
    }
    several->square[place] = square;
    several->number[place] = number;
}

static float reach_of(const Several *several)
{
    return several->found < several->wanted ? INFINITY : several->square[several->wanted - 1];
}

static void enter_leaf(Several *several, const float *light, const Table *table, const int leaf)
{
    for (int e = leaf * LEAF; e < (leaf + 1) * LEAF; ++e) {
        float square = 0.0f;
        for (int k = 0; k < LIGHTS; ++k) {
            const float away = table->entries[e * LIGHTS + k] - light[k];
            square += away * away;
        }
        enter(several, square, table->numbers[e]);
    }
}

static void walk_for_several(
    Several *several, const float *light, const float *point, const Table *table)
{
    enter_leaf(several, light, table, descend(table, point, point));
    for (int group = 0; group < table->groups; ++group) {
        Boxes tops = within(gaps(point, point, boxes_of_tops(table, group)), reach_of(several));
        while (tops) {
            const int top = 16 * group + take(&tops);
            if (top >= table->tops) continue;
            Boxes middles
                = within(gaps(point, point, boxes_of_middles(table, top)), reach_of(several));
            while (middles) {
                const int middle = 16 * top + take(&middles);
                Boxes leaves = within(
                    gaps(point, point, boxes_of_leaves(table, middle)), reach_of(several));
                while (leaves)
                    enter_leaf(several, light, table, 16 * middle + take(&leaves));
            }
        }
    }
}

// The mean slope of several nearest entries, pixel by pixel.
__kernel void lut_nearest_several(
    __global const float *restrict light,
    __global const uchar *restrict shadow,
    __global const float *restrict entries,
    __global const int *restrict numbers,
    __global const float *restrict slopes,
    __global const float *restrict boxes,
    __global const float *restrict axes,
    __global const float *restrict centres,
    __global const int *restrict tables,
    __global float *restrict out,
    const int H, const int W,
    const int neighbours)
{
    GRID_2(y, x, H, W)
    const int size = H * W, pixel = y * W + x;
    const int t = table_of(light, shadow[pixel], pixel, size);
    const Table table = read_table(t, entries, numbers, boxes, axes, centres, tables);
    float value[LIGHTS], point[LIGHTS];
    for (int k = 0; k < LIGHTS; ++k)
        value[k] = k == t - 1 ? 0.0f : tame(light[k * size + pixel]);
    for (int j = 0; j < LIGHTS; ++j) {
        point[j] = -table.centre[j];
        for (int k = 0; k < LIGHTS; ++k) point[j] += table.axes[j * LIGHTS + k] * value[k];
    }
    Several several;
    several.wanted = neighbours;
    several.found = 0;
    if (table.tops) walk_for_several(&several, value, point, &table);
    __global const float *slope = slopes + 2 * tables[4 * t + 3];
    float p = 0.0f, q = 0.0f;
    for (int n = 0; n < several.found; ++n) {
        p += slope[2 * several.number[n]];
        q += slope[2 * several.number[n] + 1];
    }
    out[pixel] = p / max(several.found, 1);
    out[size + pixel] = q / max(several.found, 1);
}
