#include "common.clh"

// 1 where no pixel of the square around is as dark as a marker.
__kernel void bare_film(
    __global const float *restrict darkness,
    __global uchar *restrict out,
    const int H, const int W,
    const float dark, const int grow_px)
{
    GRID_2(y, x, H, W)
    uchar bare = 1;
    for (int j = max(y - grow_px, 0); j <= min(y + grow_px, H - 1); ++j)
        for (int i = max(x - grow_px, 0); i <= min(x + grow_px, W - 1); ++i)
            if (darkness[j * W + i] > dark) bare = 0;
    out[y * W + x] = bare;
}
