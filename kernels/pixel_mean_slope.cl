#include "common.clh"

static float3 normal_at(__global const float *slope, const int size, const int i)
{
    const float p = slope[i], q = slope[size + i];
    const float nz = 1.0f / sqrt(1.0f + p * p + q * q);
    return (float3)(-p * nz, -q * nz, nz);
}

// Slopes corrected for the change of the normal within a pixel.
__kernel void pixel_mean_slope(
    __global const float *restrict slope,
    __global float *restrict out,
    const int H, const int W,
    const float most)
{
    GRID_2(y, x, H, W)
    const int size = H * W, i = y * W + x;
    const float p = slope[i], q = slope[size + i];
    const float square = 1.0f + p * p + q * q;
    float add_p = 0.0f, add_q = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        const int at = axis ? x : y, end = (axis ? W : H) - 1, stride = axis ? 1 : W;
        const int before = max(at - 1, 0), after = min(at + 1, end);
        const float3 d = (normal_at(slope, size, i + (after - at) * stride)
                          - normal_at(slope, size, i + (before - at) * stride))
            / (float)max(after - before, 1);
        add_p += (d.x * d.z + p * d.z * d.z) * square * (1.0f / 12.0f);
        add_q += (d.y * d.z + q * d.z * d.z) * square * (1.0f / 12.0f);
    }
    const float limit = most * square;
    out[i] = p + clamp(add_p, -limit, limit);
    out[size + i] = q + clamp(add_q, -limit, limit);
}
