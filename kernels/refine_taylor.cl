#include "common.clh"

// First-order Taylor steps of the spherical-harmonic reflectance on fully lit pixels.
__kernel void refine_taylor(
    __global const float *restrict light,
    __global const float *restrict slope,
    __global const uchar *restrict shadow,
    __global const float *restrict reflectance,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int steps,
    const float limit)
{
    GRID_2(yy, xx, H, W)
    const int size = H * W, i = yy * W + xx;
    float p = slope[i], q = slope[size + i];
    const int count = shadow[i] ? 0 : steps;
    for (int step = 0; step < count; ++step) {
        const float square = 1.0f + p * p + q * q;
        const float w = 1.0f / sqrt(square);
        const float x = -p * w, y = -q * w, z = w;
        const float cube = w / square;
        const float xp = p * p * cube - w, yp = p * q * cube, zp = -p * cube;
        const float xq = p * q * cube, yq = q * q * cube - w, zq = -q * cube;
        float a = 0.0f, b = 0.0f, c = 0.0f, u = 0.0f, v = 0.0f;
        for (int k = 0; k < K; ++k) {
            __global const float *l = reflectance + 9 * k;
            const float value = l[0] + l[1] * x + l[2] * y + l[3] * z
                + l[4] * (x * y) + l[5] * (x * z) + l[6] * (y * z)
                + l[7] * (x * x - y * y) + l[8] * (3.0f * z * z - 1.0f);
            const float rx = l[1] + l[4] * y + l[5] * z + 2.0f * l[7] * x;
            const float ry = l[2] + l[4] * x + l[6] * z - 2.0f * l[7] * y;
            const float rz = l[3] + l[5] * x + l[6] * y + 6.0f * l[8] * z;
            const float jp = rx * xp + ry * yp + rz * zp;
            const float jq = rx * xq + ry * yq + rz * zq;
            const float rest = light[k * size + i] - value;
            a += jp * jp;
            b += jp * jq;
            c += jq * jq;
            u += jp * rest;
            v += jq * rest;
        }
        const float determinant = fmax(a * c - b * b, 1e-12f);
        const float dp = (c * u - b * v) / determinant;
        const float dq = (a * v - b * u) / determinant;
        const float length_ = sqrt(dp * dp + dq * dq);
        const float shrink = fmin(1.0f, limit * square / fmax(length_, 1e-12f));
        p += dp * shrink;
        q += dq * shrink;
    }
    out[i] = p;
    out[size + i] = q;
}
