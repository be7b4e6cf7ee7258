#include "common.clh"

#define SHADES 9
#define DEGREE 4
#define TERMS 15
#define LIGHTS 8

// The monomials 1, u, v, u^2, u v, v^2, ... of the place.
void monomials(const float u, const float v, float place[TERMS])
{
    place[0] = 1.0f;
    int last = 0;
    for (int degree = 1; degree <= DEGREE; ++degree) {
        const int first = last + degree;
        for (int i = 0; i < degree; ++i) place[first + i] = place[last + i] * u;
        place[first + degree] = place[first - 1] * v;
        last = first;
    }
}

// Gauss-Newton for the slope that explains the light under a reflectance that varies.
__kernel void solve_reflectance_map(
    __global const float *restrict light,
    __global const float *restrict flat,
    __global const float *restrict height,
    __global const float *restrict reflectance,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int steps,
    const float prior,
    const float limit)
{
    GRID_2(yy, xx, H, W)
    const int size = H * W, i = yy * W + xx;
    const float scale = 0.5f * (float)W;
    const float column = ((float)xx - 0.5f * (float)(W - 1)) / scale;
    const float row = ((float)yy - 0.5f * (float)(H - 1)) / scale;
    float place[TERMS], coefficients[LIGHTS][SHADES], rest[LIGHTS];
    monomials(column, row, place);
    for (int k = 0; k < K; ++k) {
        for (int b = 0; b < SHADES; ++b) {
            __global const float *map = reflectance + (k * SHADES + b) * TERMS;
            float sum = 0.0f;
            for (int term = 0; term < TERMS; ++term) sum += map[term] * place[term];
            coefficients[k][b] = sum;
        }
        rest[k] = light[k * size + i] - 1.0f - coefficients[k][SHADES - 1] * height[i];
    }
    float p = 0.0f, q = 0.0f;
    for (int step = 0; step < steps; ++step) {
        const float square = 1.0f + p * p + q * q;
        const float w = 1.0f / sqrt(square);
        const float x = -p * w, y = -q * w, z = w;
        const float cube = w / square;
        const float xp = p * p * cube - w, yp = p * q * cube, zp = -p * cube;
        const float xq = p * q * cube, yq = q * q * cube - w, zq = -q * cube;
        float a = prior, b = 0.0f, c = prior, s = -prior * p, t = -prior * q;
        for (int k = 0; k < K; ++k) {
            const float *l = coefficients[k];
            const float weight = flat[k * size + i];
            const float value = l[0] * x + l[1] * y + l[2] * (z - 1.0f)
                + l[3] * (x * y) + l[4] * (x * z) + l[5] * (y * z)
                + l[6] * (x * x - y * y) + l[7] * (3.0f * (z * z - 1.0f));
            const float rx = l[0] + l[3] * y + l[4] * z + 2.0f * l[6] * x;
            const float ry = l[1] + l[3] * x + l[5] * z - 2.0f * l[6] * y;
            const float rz = l[2] + l[4] * x + l[5] * y + 6.0f * l[7] * z;
            const float jp = rx * xp + ry * yp + rz * zp;
            const float jq = rx * xq + ry * yq + rz * zq;
            const float left = rest[k] - value;
            const float wp = weight * jp, wq = weight * jq;
            a += wp * jp;
            b += wp * jq;
            c += wq * jq;
            s += wp * left;
            t += wq * left;
        }
        const float determinant = fmax(a * c - b * b, 1e-12f);
        const float dp = (c * s - b * t) / determinant;
        const float dq = (a * t - b * s) / determinant;
        const float length_ = sqrt(dp * dp + dq * dq);
        const float shrink = fmin(1.0f, limit * square / fmax(length_, 1e-12f));
        p += dp * shrink;
        q += dq * shrink;
    }
    out[i] = p;
    out[size + i] = q;
}
