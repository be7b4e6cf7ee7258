#include "common.clh"
#include "bend.clh"

// Where equation H2 of docs/model.md does not hold.
// 1 where the largest bend of 3 x 3 pixels is that of an edge within one of them.
LANED __kernel void unresolved_edges(
    __global const float *restrict height,
    const float pixel,
    const float blur,
    __global uchar *restrict out,
    const int H, const int W,
    const float resolved_px)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const floats edge = largest_bend(height, y, x, count, H, W) * sqrt(1.0f + 12.0f * blur * blur);
    const ints yes = 1, no = 0;
    store_bytes(edge > resolved_px * pixel ? yes : no, out + y * W + x, count);
}
