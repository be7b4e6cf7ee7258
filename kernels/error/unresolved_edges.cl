#include "common.clh"
#include "bend.clh"

// Where equation H2 of docs/model.md does not hold.
// 1 where the largest bend of 3 x 3 pixels is that of an edge within one of them.
LANED __kernel void unresolved_edges(
    __global const float *restrict height,
    const float pixel,
    __global uchar *restrict out,
    const int H, const int W,
    const float resolved_px)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    floats largest = 0.0f;
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            const floats there = squared_bend(height, clamp(y + dy, 0, H - 1), x + dx, count, H, W);
            largest = MORE_OF(largest, there);
        }
    const float most = resolved_px * pixel;
    const ints yes = 1, no = 0;
    store_bytes(sqrt(largest) > most ? yes : no, out + y * W + x, count);
}
