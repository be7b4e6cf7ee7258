#include "common.clh"
#include "spread.clh"

// The part of the object in front of the film at rest, which is the film's initial shape.
__kernel void rise(
    __global const float *restrict object,
    __global float *restrict obstacle,
    __global float *restrict film,
    const int H, const int W, const float stand_off)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    const float above = fmax(object[i] - stand_off, 0.0f);
    obstacle[i] = above;
    film[i] = above;
}

// Half a sweep of projected successive over-relaxation: the pixels of one colour of a
// chessboard, whose neighbours have the other colour.  One work-item per two pixels of a row.
__kernel void settle(
    __global const float *restrict obstacle,
    __global float *film,
    const int H, const int W, const int colour, const float share, const float relax)
{
    GRID_2(y, pair, H, (W + 1) / 2)
    const int x = 2 * pair + ((y + colour) & 1);
    if (x >= W)
        return;
    const int i = y * W + x;
    const float here = film[i];
    const float pull = film[max(y - 1, 0) * W + x] + film[min(y + 1, H - 1) * W + x]
                       + film[y * W + max(x - 1, 0)] + film[y * W + min(x + 1, W - 1)];
    film[i] = fmax(here + relax * (pull * share - here), obstacle[i]);
}
