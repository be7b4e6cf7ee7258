#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define LOOSE_VARIANCE 0.2f

// Heights of a row next to those of a work-item.
#define AT(row, dx) load_within_border(row, x + (dx), count, W, REPLICATE)

// Loose pixels move by the smallest of their departures along the four lines through them.
LANED __kernel void settle_loose(
    __global const float *restrict height,
    __global const float *restrict variance,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int i = y * W + x;
    const floats z = load_floats(height + i, count), none = 0.0f;
    const floats first = load_floats(variance + i, count);
    const floats second = load_floats(variance + H * W + i, count);
    const ints moves = LESS_OF(first, second) > LOOSE_VARIANCE;
    if (!ANY(moves)) {
        store_floats(z, out + i, count);
        return;
    }
    __global const float *here = height + y * W;
    __global const float *above = height + max(y - 1, 0) * W;
    __global const float *below = height + min(y + 1, H - 1) * W;
    const floats a = z - 0.5f * (AT(here, 1) + AT(here, -1));
    const floats b = z - 0.5f * (AT(below, 0) + AT(above, 0));
    const floats c = z - 0.5f * (AT(below, 1) + AT(above, -1));
    const floats d = z - 0.5f * (AT(below, -1) + AT(above, 1));
    const floats low = LESS_OF(a, b), low_too = LESS_OF(c, d), lowest = LESS_OF(low, low_too);
    const floats high = MORE_OF(a, b), high_too = MORE_OF(c, d), highest = MORE_OF(high, high_too);
    const floats least = MORE_OF(lowest, none) + LESS_OF(highest, none);
    store_floats(moves ? z - least : z, out + i, count);
}
