#include "common.clh"
#include "bend.clh"

#define PLACE_VARIANCE_PX2 0.083333333f
// Equation H2 of docs/model.md does not hold for an edge within one of 3 x 3 pixels: 1 there.
LANED __kernel void unresolved_edges(
    __global const float *restrict height,
    const float pixel,
    const float blur,
    __global uchar *restrict out,
    const int H, const int W,
    const float resolved_px)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const float wider = sqrt(1.0f + blur * blur / PLACE_VARIANCE_PX2);
    const floats edge = wider * largest_bend(height, y, x, count, H, W);
    const ints yes = 1, no = 0;
    store_bytes(edge > resolved_px * pixel ? yes : no, out + y * W + x, count);
}
