#include "common.clh"

#define MOST_LIGHTS 8
#define MOST_NEIGHBOURS 16
#define DEEPEST 32

// The nearest entries so far, nearest first; of equally near ones the first in the table.
typedef struct {
    int wanted, found;
    float square[MOST_NEIGHBOURS];
    int entry[MOST_NEIGHBOURS];
} Nearest;

static float farthest(const Nearest *n)
{
    return n->found < n->wanted ? INFINITY : n->square[n->wanted - 1];
}

static void enter(Nearest *n, const float square, const int entry)
{
    const int last = n->wanted - 1;
    if (n->found == n->wanted
        && (square > n->square[last] || (square == n->square[last] && entry > n->entry[last])))
        return;
    int place = n->found < n->wanted ? n->found++ : last;
    while (place > 0
           && (square < n->square[place - 1]
               || (square == n->square[place - 1] && entry < n->entry[place - 1]))) {
        n->square[place] = n->square[place - 1];
        n->entry[place] = n->entry[place - 1];
        --place;
    }
    n->square[place] = square;
    n->entry[place] = entry;
}

// Squared distance from a point to a node's box, along the principal axes.
static float gap(const float *point, __global const float *box, const int K)
{
    float square = 0.0f;
    for (int k = 0; k < K; ++k) {
        const float away = fmax(fmax(box[k] - point[k], point[k] - box[K + k]), 0.0f);
        square += away * away;
    }
    // A little less than computed, so that rounding never prunes the nearest entry.
    return square * 0.9999f;
}

// Exact nearest entries by depth-first descent of a complete k-d tree, nearer child first.
__kernel void lut_nearest(
    __global const float *restrict light,
    __global const uchar *restrict shadow,
    __global const float *restrict index_entries,
    __global const float *restrict index_slopes,
    __global const float *restrict index_boxes,
    __global const float *restrict index_axes,
    __global const int *restrict index_tables,
    __global float *restrict out,
    const int K, const int H, const int W, const int M, const int B, const int T,
    const int neighbours)
{
    GRID_2(y, x, H, W)
    const int size = H * W, i = y * W + x;
    float value[MOST_LIGHTS], point[MOST_LIGHTS];
    int table = 0;
    float least = INFINITY;
    for (int k = 0; k < K; ++k) {
        value[k] = light[k * size + i];
        if ((shadow[i] >> k & 1) && value[k] < least) {
            least = value[k];
            table = k + 1;
        }
    }
    if (table) value[table - 1] = 0.0f;

    const int leaves = index_tables[4 * table], filled = index_tables[4 * table + 1];
    __global const float *boxes = index_boxes + 2 * K * index_tables[4 * table + 2];
    const int first = index_tables[4 * table + 3];
    __global const float *axes = index_axes + table * K * K;
    for (int j = 0; j < K; ++j) {
        point[j] = 0.0f;
        for (int k = 0; k < K; ++k) point[j] += axes[j * K + k] * value[k];
    }

    Nearest nearest;
    nearest.wanted = neighbours;
    nearest.found = 0;
    int stack[DEEPEST], depth = 0;
    float gaps[DEEPEST];
    int node = leaves ? 1 : 0;
    float here = 0.0f;
    while (node) {
        while (node < leaves && here <= farthest(&nearest)) {
            const float left = gap(point, boxes + 2 * K * (2 * node), K);
            const float right = gap(point, boxes + 2 * K * (2 * node + 1), K);
            const int nearer = right < left;
            stack[depth] = 2 * node + !nearer;
            gaps[depth++] = nearer ? left : right;
            here = nearer ? right : left;
            node = 2 * node + nearer;
        }
        if (here <= farthest(&nearest)) {
            const int start = first + (node - leaves) * filled;
            for (int e = start; e < start + filled; ++e) {
                float square = 0.0f;
                for (int k = 0; k < K; ++k) {
                    const float away = index_entries[e * K + k] - value[k];
                    square += away * away;
                }
                enter(&nearest, square, e);
            }
        }
        node = 0;
        while (depth > 0 && !node) {
            --depth;
            here = gaps[depth];
            if (here <= farthest(&nearest)) node = stack[depth];
        }
    }
    float p = 0.0f, q = 0.0f;
    for (int n = 0; n < nearest.found; ++n) {
        p += index_slopes[2 * nearest.entry[n]];
        q += index_slopes[2 * nearest.entry[n] + 1];
    }
    out[i] = p / max(nearest.found, 1);
    out[size + i] = q / max(nearest.found, 1);
}
