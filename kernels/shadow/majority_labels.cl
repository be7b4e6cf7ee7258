#include "common.clh"

// Per LED what the majority of 3 x 3 pixels says; the border goes on beyond the frame.
__kernel void majority_labels(
    __global const uchar *restrict shadow,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    uint votes = 0;  // four bits for each LED hold up to nine votes
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            const int row = clamp(y + dy, 0, H - 1), column = clamp(x + dx, 0, W - 1);
            const uint label = shadow[row * W + column];
            for (int bit = 0; bit < 8; ++bit) votes += (label >> bit & 1u) << (4 * bit);
        }
    uint majority = 0;
    for (int bit = 0; bit < 8; ++bit) majority |= (uint)((votes >> (4 * bit) & 15u) > 4u) << bit;
    out[y * W + x] = (uchar)majority;
}
