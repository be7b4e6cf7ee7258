#include "common.clh"
#include "border.clh"

#define MAX_TURN 1.25f
#define MIN_LEDS 3

// Whether LANES cells are rims: the slope turns too much towards a neighbour, or few LEDs are lit.
LANED __kernel void rim_cells(
    __global const float *restrict slope,
    __global const uchar *restrict used,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int size = H * W, rows[4] = {y, y, max(y - 1, 0), min(y + 1, H - 1)};
    const int columns[4] = {x - 1, x + 1, x, x};
    const floats p = load_floats(slope + y * W + x, count);
    const floats q = load_floats(slope + size + y * W + x, count);
    ints turns = 0;
    for (int n = 0; n < 4; ++n) {
        __global const float *row = slope + rows[n] * W;
        const floats dp = load_within_border(row, columns[n], count, W, REPLICATE) - p;
        const floats dq = load_within_border(row + size, columns[n], count, W, REPLICATE) - q;
        turns |= dp * dp + dq * dq > MAX_TURN * MAX_TURN;
    }
    const ints leds = load_bytes(used + y * W + x, count), one = 1, none = 0;
    const ints steep = p * p + q * q > MAX_TURN * MAX_TURN;
    const ints rim = (turns & steep) | (has_bits(leds, MIN_LEDS) == 0);
    store_bytes(rim ? one : none, out + y * W + x, count);
}
