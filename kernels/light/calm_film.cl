#include "common.clh"
#include "lanes.clh"
#include "border.clh"

// 1 where the mean light of every LED over a window is 1 within its noise.
LANED __kernel void calm_film(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict at_rest,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const int radius_px,
    const float level,
    const float roughness)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int size = H * W, i = y * W + x;
    const float width = (float)(2 * radius_px + 1);
    const int inside = count == LANES && x >= radius_px && x + LANES + radius_px <= W;
    const ints one = 1, none = 0;
    ints calm = one;
    for (int k = 0; k < K && ANY(calm); ++k) {
        floats sum = 0.0f;
        for (int dy = -radius_px; dy <= radius_px; ++dy) {
            __global const float *row = light + k * size + clamp(y + dy, 0, H - 1) * W;
            for (int dx = -radius_px; dx <= radius_px; ++dx) {
                const floats result = inside ? LOAD_LANES(row + x + dx)
                                            : load_within_border(row, x + dx, count, W, REPLICATE);
                if (at_rest) {
                    __global const float *low = at_rest + (row - light);
                    sum += result - (inside ? LOAD_LANES(low + x + dx)
                                           : load_within_border(low, x + dx, count, W, REPLICATE));
                } else {
                    sum += result - 1.0f;
                }
            }
        }
        floats most = width * roughness;
        if (sigma)
            most = level * load_floats(sigma + k * size + i, count);
        calm = fabs(sum) / width < most ? calm : none;
    }
    store_bytes(calm, out + i, count);
}
