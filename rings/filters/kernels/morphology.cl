#include "common.clh"

// The lowest, or highest, value under a structuring element of (2 * radius + 1)^2 flags;
// pixels beyond the frame do not count.
__kernel void extreme(
    __global const uchar *restrict mask,
    __global const uchar *restrict element,
    __global uchar *restrict out,
    const int H, const int W,
    const int radius,
    const int highest)
{
    GRID_2(y, x, H, W)
    const int top = max(y - radius, 0), bottom = min(y + radius, H - 1);
    const int left = max(x - radius, 0), right = min(x + radius, W - 1);
    const int side = 2 * radius + 1;
    uchar found = highest ? 0 : 255;
    for (int row = top; row <= bottom; ++row)
        for (int column = left; column <= right; ++column) {
            if (!element[(row - y + radius) * side + column - x + radius]) continue;
            const uchar value = mask[row * W + column];
            found = highest ? max(found, value) : min(found, value);
        }
    out[y * W + x] = found;
}
