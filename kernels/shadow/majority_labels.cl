#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// Each of eight bits into the lowest of four, and back.
static ints spread(const ints bits)
{
    const ints halves = (bits | bits << 12) & 0x000f000f;
    const ints quarters = (halves | halves << 6) & 0x03030303;
    return (quarters | quarters << 3) & 0x11111111;
}

static ints gathered(const ints spread_)
{
    const ints quarters = (spread_ | spread_ >> 3) & 0x03030303;
    const ints halves = (quarters | quarters >> 6) & 0x000f000f;
    return (halves | halves >> 12) & 0xff;
}

// Per LED the majority label of 3 x 3 pixels; beyond the frame the border repeats.
LANED __kernel void majority_labels(
    __global const uchar *restrict shadow,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    ints votes = 0x33333333;  // four bits for each LED: three, and nine votes at most
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            __global const uchar *row = shadow + clamp(y + dy, 0, H - 1) * W;
            votes += spread(load_bytes_within_border(row, x + dx, count, W, REPLICATE));
        }
    // Five votes and three are eight.
    store_bytes(gathered(votes >> 3 & 0x11111111), out + y * W + x, count);
}
