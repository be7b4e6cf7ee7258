// Equation V5 of docs/model.md.
#include "common.clh"
#include "normals.clh"
#include "lens.clh"

#define RESAMPLING_VARIANCE (1.0f / 15.0f)

// The slopes without the camera's blur.
LANED __kernel void sharpen_slope(
    __global const float *restrict slope, const float blur, const float refraction,
    __global const float *restrict diffuse, __global const float *lens,
    __global float *restrict out, const int H, const int W, const int K, const float most)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int size = H * W, i = y * W + x;
    __global const float *row = slope + y * W;
    __global const float *above = slope + max(y - 2, 0) * W, *below = slope + min(y + 2, H - 1) * W;
    const Vector n = normals(row, size, x, count, W);
    const Vector before = normals(row, size, x - 2, count, W);
    const Vector after = normals(row, size, x + 2, count, W);
    const Vector over = normals(above, size, x, count, W), under = normals(below, size, x, count, W);
    const float resampled = lens && is_bent(lens) ? RESAMPLING_VARIANCE : 0.0f;
    float by = 0.125f * fmax(blur * blur - resampled, 0.0f);
    for (int k = 0; k < K; ++k) by = refraction != 1.0f || diffuse[k] != 0.0f ? 0.0f : by;
    const float own = 1.0f + 4.0f * by;
    const floats nx = own * n.x - by * (before.x + after.x + over.x + under.x);
    const floats ny = own * n.y - by * (before.y + after.y + over.y + under.y);
    const floats sharp = own * n.z - by * (before.z + after.z + over.z + under.z);
    const floats least = 0.5f * n.z, nz = MORE_OF(sharp, least);
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats limit = most * (1.0f + p * p + q * q);
    store_floats(p + clipped(-nx / nz - p, limit), out + i, count);
    store_floats(q + clipped(-ny / nz - q, limit), out + size + i, count);
}
