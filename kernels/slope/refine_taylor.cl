#include "common.clh"
#include "lanes.clh"

// The spherical-harmonic reflectance of one LED, and its derivative with respect to the normal.
static floats reflect(
    __global const float *l, const floats x, const floats y, const floats z, floats *by_x,
    floats *by_y, floats *by_z)
{
    *by_x = l[1] + l[4] * y + l[5] * z + 2.0f * l[7] * x;
    *by_y = l[2] + l[4] * x + l[6] * z - 2.0f * l[7] * y;
    *by_z = l[3] + l[5] * x + l[6] * y + 6.0f * l[8] * z;
    return l[0] + l[1] * x + l[2] * y + l[3] * z + l[4] * (x * y) + l[5] * (x * z)
        + l[6] * (y * z) + l[7] * (x * x - y * y) + l[8] * (3.0f * z * z - 1.0f);
}

// First-order Taylor steps of the spherical-harmonic reflectance on fully lit pixels.
LANED __kernel void refine_taylor(
    __global const float *restrict light, __global const float *restrict slope,
    __global const uchar *restrict shadow, __global const float *restrict reflectance,
    __global float *restrict out, const int K, const int H, const int W, const int steps,
    const float max_turn_rad)
{
    GRID_LANES(i, count, H * W)
    const int size = H * W;
    const ints lit = load_bytes(shadow + i, count) == (ints)(0);
    floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    for (int step = 0; step < steps; ++step) {
        const floats square = 1.0f + p * p + q * q;
        const floats w = 1.0f / sqrt(square);
        const floats x = -p * w, y = -q * w, z = w;
        const floats cube = w / square;
        const floats xp = p * p * cube - w, yp = p * q * cube, zp = -p * cube;
        const floats xq = p * q * cube, yq = q * q * cube - w, zq = -q * cube;
        floats a = 0.0f, b = 0.0f, c = 0.0f, u = 0.0f, v = 0.0f;
        for (int k = 0; k < K; ++k) {
            floats rx, ry, rz;
            const floats value = reflect(reflectance + 9 * k, x, y, z, &rx, &ry, &rz);
            const floats jp = rx * xp + ry * yp + rz * zp;
            const floats jq = rx * xq + ry * yq + rz * zq;
            const floats rest = load_floats(light + k * size + i, count) - value;
            a += jp * jp;
            b += jp * jq;
            c += jq * jq;
            u += jp * rest;
            v += jq * rest;
        }
        const floats smallest = 1e-12f;
        const floats determinant = fmax(a * c - b * b, smallest);
        const floats dp = (c * u - b * v) / determinant;
        const floats dq = (a * v - b * u) / determinant;
        const floats length_ = sqrt(dp * dp + dq * dq);
        const floats shrink = fmin((floats)(1.0f), max_turn_rad * square / fmax(length_, smallest));
        p = lit ? p + dp * shrink : p;
        q = lit ? q + dq * shrink : q;
    }
    store_floats(p, out + i, count);
    store_floats(q, out + size + i, count);
}
