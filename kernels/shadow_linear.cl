#include "common.clh"

// Label the darkest LED where the null vector's product with the light departs from zero.
__kernel void shadow_linear(
    __global const float *restrict light,
    __global const float *restrict null,
    const float spread,
    __global uchar *restrict out,
    const int K, const int H, const int W,
    const float threshold)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    float departure = 0.0f, least = INFINITY;
    int darkest = 0;
    for (int k = 0; k < K; ++k) {
        const float value = light[k * H * W + i];
        departure += null[k] * value;
        if (value < least) {
            least = value;
            darkest = k;
        }
    }
    out[i] = fabs(departure) > threshold * spread ? 1 << darkest : 0;
}
