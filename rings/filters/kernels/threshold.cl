#include "common.clh"

// 1 where the light of all LEDs (lights 0), or of any (lights 1), exceeds the level.
__kernel void threshold(
    __global const float *restrict light,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const float level,
    const int lights)
{
    GRID_2(y, x, H, W)
    int brighter = 0;
    for (int k = 0; k < K; ++k) brighter += light[(k * H + y) * W + x] > level;
    out[y * W + x] = lights ? brighter > 0 : brighter == K;
}
