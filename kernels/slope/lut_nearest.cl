#include "common.clh"
#ifndef LIGHTS
#define LIGHTS 4
#endif
#include "lanes.clh"
#include "table_tree.clh"

// The entries nearest to a packet of pixels: of equally near ones the first in the table.
typedef struct {
    floats square;
    ints number, leaf;
} Nearest;

static void scan_leaf(
    Nearest *nearest, const floats *light, const Table *table, const int leaf)
{
    __global const float *entry = table->entries + leaf * LEAF_ENTRIES * LIGHTS;
    floats square[LEAF_ENTRIES];
    #pragma unroll
    for (int e = 0; e < LEAF_ENTRIES; ++e) {
        square[e] = (floats)(0.0f);
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k) {
            const floats away = entry[e * LIGHTS + k] - light[k];
            square[e] = fma(away, away, square[e]);
        }
    }
    floats least = square[0];
    #pragma unroll
    for (int e = 1; e < LEAF_ENTRIES; ++e) least = LESS_OF(square[e], least);
    if (!ANY(least <= nearest->square)) return;
    __global const int *numbers = table->numbers + leaf * LEAF_ENTRIES;
    ints number = (ints)(INT_MAX);
    #pragma unroll
    for (int e = 0; e < LEAF_ENTRIES; ++e) {
        const ints here = (ints)(numbers[e]);
        number = ((square[e] == least) & (here < number)) ? here : number;
    }
    const ints closer = (least < nearest->square)
        | ((least == nearest->square) & (number < nearest->number));
    nearest->square = closer ? least : nearest->square;
    nearest->number = closer ? number : nearest->number;
    nearest->leaf = closer ? (ints)(leaf) : nearest->leaf;
}

// A packet of pixels: its light, that light along the table's axes, the box around it, and two
// leaves that are likely to be near.
typedef struct {
    floats light[LIGHTS], point[LIGHTS];
    float low[LIGHTS], high[LIGHTS];
    int first, second;
} Packet;

// Scan the leaves of one middle that may hold an entry nearer to some pixel.
static void walk_middle(
    Nearest *nearest, const Packet *packet, const Table *table, const int middle,
    const float reach)
{
    __global const float *leaves = boxes_of_leaves(table, middle);
    for (Boxes near = within(gaps(packet->low, packet->high, leaves), reach); near;) {
        const int l = take(&near), leaf = 16 * middle + l;
        if (leaf != packet->first && leaf != packet->second
            && ANY(gap(packet->point, leaves, l) <= nearest->square))
            scan_leaf(nearest, packet->light, table, leaf);
    }
}

// Scan the two likely leaves, then their surroundings, then what else may be near.
static void walk(Nearest *nearest, const Packet *packet, const Table *table)
{
    const int first = packet->first / 16, second = packet->second / 16;
    scan_leaf(nearest, packet->light, table, packet->first);
    if (packet->second != packet->first)
        scan_leaf(nearest, packet->light, table, packet->second);
    walk_middle(nearest, packet, table, first, highest_lane(nearest->square));
    if (second != first)
        walk_middle(nearest, packet, table, second, highest_lane(nearest->square));
    float reach = highest_lane(nearest->square);
    for (int group = 0; group < table->groups; ++group) {
        __global const float *tops = boxes_of_tops(table, group);
        for (Boxes near_tops = within(gaps(packet->low, packet->high, tops), reach); near_tops;) {
            const int t = take(&near_tops), top = 16 * group + t;
            if (!ANY(gap(packet->point, tops, t) <= nearest->square)) continue;
            __global const float *middles = boxes_of_middles(table, top);
            for (Boxes near = within(gaps(packet->low, packet->high, middles), reach); near;) {
                const int m = take(&near), middle = 16 * top + m;
                if (middle == first || middle == second
                    || !ANY(gap(packet->point, middles, m) <= nearest->square))
                    continue;
                walk_middle(nearest, packet, table, middle, reach);
                reach = highest_lane(nearest->square);
            }
        }
    }
}

// Fill in a packet's coordinates along the table's axes, and the box around its pixels.
static void place(Packet *packet, const Table *table)
{
    #pragma unroll
    for (int j = 0; j < LIGHTS; ++j) {
        packet->point[j] = (floats)(-table->centre[j]);
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k)
            packet->point[j]
                = mad((floats)(table->axes[j * LIGHTS + k]), packet->light[k], packet->point[j]);
        packet->low[j] = lowest_lane(packet->point[j]);
        packet->high[j] = highest_lane(packet->point[j]);
    }
}

#if LANES == 1
// The slope of the entry nearest in light, a pixel per work-item: a packet of one.
__kernel void lut_nearest(
    __global const float *restrict light, __global const uchar *restrict shadow, INDEX,
    __global float *restrict out, const int H, const int W)
{
    GRID_2(y, x, H, W)
    const int size = H * W, pixel = y * W + x;
    const int t = table_of(light, shadow[pixel], pixel, size);
    const Table table = read_table(t, INDEX_ARRAYS);
    Packet packet;
    for (int k = 0; k < LIGHTS; ++k)
        packet.light[k] = k == t - 1 ? 0.0f : tame(light[k * size + pixel]);
    Nearest nearest = {FLT_MAX, INT_MAX, 0};
    if (table.tops) {
        place(&packet, &table);
        packet.first = packet.second = descend(&table, packet.low, packet.high);
        walk(&nearest, &packet, &table);
    }
    for (int axis = 0; axis < 2; ++axis)
        out[axis * size + pixel] = table.tops ? table.slopes[2 * nearest.number + axis] : 0.0f;
}

#else
#include "sort_by_light.clh"

// Find the entries of `count` pixels; the leaves of one packet are where the next one starts.
static ONCE void search(
    int *result, const float light[LIGHTS][PADDED], const ushort *order, const int count,
    const Table *table)
{
    int leaves[LANES];
    for (int i = 0; i < count; i += LANES) {
        Packet packet;
        #pragma unroll
        for (int k = 0; k < LIGHTS; ++k) {
            float gathered[LANES];
            for (int l = 0; l < LANES; ++l) gathered[l] = light[k][order[i + l]];
            packet.light[k] = LOAD_LANES(gathered);
        }
        place(&packet, table);
        if (i == 0)
            leaves[LANES - 1] = leaves[LANES / 2] = descend(table, packet.low, packet.high);
        packet.first = leaves[LANES - 1];
        packet.second = leaves[LANES / 2];
        Nearest nearest = {(floats)(FLT_MAX), (ints)(INT_MAX), (ints)(0)};
        walk(&nearest, &packet, table);
        STORE_LANES(nearest.leaf, leaves);
        STORE_LANES(nearest.number, result + i);
    }
}

// The slope of the entry nearest in light for all pixels of a cell, a cell per work-item.
__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void search_cells(
    __global const float *restrict sorted,
    __global const int *restrict starts,
    INDEX,
    __global float *restrict result_slopes,
    const int levels)
{
    const int cell = get_global_id(0), t = table_of_cell(cell, levels);
    const Table table = read_table(t, INDEX_ARRAYS);
    for (int from = starts[cell]; from < starts[cell + 1]; from += CELL_PIXELS) {
        const int count = min(CELL_PIXELS, starts[cell + 1] - from);
        if (table.tops == 0) {
            for (int i = 0; i < 2 * count; ++i) result_slopes[2 * from + i] = 0.0f;
            continue;
        }
        float value[LIGHTS][PADDED];
        ushort order[PADDED];
        int result[PADDED];
        // The last packet is padded with the last pixel.
        for (int i = 0; i < count; ++i)
            for (int k = 0; k < LIGHTS; ++k)
                value[k][i] = k == t - 1 ? 0.0f : tame(sorted[LIGHTS * (from + i) + k]);
        for (int k = 0; k < LIGHTS; ++k)
            for (int i = count; i < count + LANES; ++i) value[k][i] = value[k][count - 1];
        sort_piece(order, value, count);
        for (int i = count; i < count + LANES; ++i) order[i] = order[count - 1];
        search(result, value, order, count, &table);
        for (int i = 0; i < count; ++i) {
            const int to = 2 * (from + order[i]);
            result_slopes[to] = table.slopes[2 * result[i]];
            result_slopes[to + 1] = table.slopes[2 * result[i] + 1];
        }
    }
}

// From the order of the cells back to that of the image.
__kernel void put_back(
    __global const float *restrict result_slopes, __global const int *restrict place,
    __global float *restrict out, const int size)
{
    CHUNK(first, past, size)
    for (int pixel = first; pixel < past; ++pixel) {
        out[pixel] = result_slopes[2 * place[pixel]];
        out[size + pixel] = result_slopes[2 * place[pixel] + 1];
    }
}
#endif
