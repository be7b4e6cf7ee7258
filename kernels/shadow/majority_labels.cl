#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// Per LED what the majority of 3 x 3 pixels says; the border goes on beyond the frame.
LANED __kernel void majority_labels(
    __global const uchar *restrict shadow,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const ints none = 0;
    ints votes = none;  // four bits for each LED hold up to nine votes
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            __global const uchar *row = shadow + clamp(y + dy, 0, H - 1) * W;
            const ints label = load_bytes_within_border(row, x + dx, count, W, REPLICATE);
            for (int bit = 0; bit < 8; ++bit) votes += ((label >> bit) & 1) << (4 * bit);
        }
    ints majority = none;
    for (int bit = 0; bit < 8; ++bit) {
        const ints led = 1 << bit;
        majority |= ((votes >> (4 * bit)) & 15) > 4 ? led : none;
    }
    store_bytes(majority, out + y * W + x, count);
}
