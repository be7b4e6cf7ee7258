#include "common.clh"
#include "lanes.clh"
#include "light_model.clh"
#include "pixels.clh"

#define MAX_LEDS 8
#define MAX_TURN_RAD 0.3f
#define MIN_START_Z 0.05f
#define MIN_LIGHT 1e-6f
#define MIN_LENGTH 1e-20f
#define MIN_DETERMINANT 1e-12f
#define MIN_EXPECTED_SHARE 0.2f
#define MIN_STEP_RAD 1e-3f

// The slope of the vector g n with the least squares of I_k - L_k.(g n), by Cramer's rule.
static void linear_slope(
    const floats *image, __global const float *linear, const floats *powers, const int count,
    const int K, floats *p, floats *q)
{
    floats xx = 0.0f, xy = 0.0f, xz = 0.0f, yy = 0.0f, yz = 0.0f, zz = 0.0f;
    floats bx = 0.0f, by = 0.0f, bz = 0.0f;
    for (int k = 0; k < K; ++k) {
        const floats x = coefficient(linear + (3 * k) * MAX_MONOMIALS, powers, count);
        const floats y = coefficient(linear + (3 * k + 1) * MAX_MONOMIALS, powers, count);
        const floats z = coefficient(linear + (3 * k + 2) * MAX_MONOMIALS, powers, count);
        xx += x * x;
        xy += x * y;
        xz += x * z;
        yy += y * y;
        yz += y * z;
        zz += z * z;
        bx += x * image[k];
        by += y * image[k];
        bz += z * image[k];
    }
    const floats c_xx = yy * zz - yz * yz, c_xy = yz * xz - xy * zz, c_xz = xy * yz - yy * xz;
    const floats c_yy = xx * zz - xz * xz, c_yz = xy * xz - xx * yz, c_zz = xx * yy - xy * xy;
    const floats x = c_xx * bx + c_xy * by + c_xz * bz;
    const floats y = c_xy * bx + c_yy * by + c_yz * bz;
    const floats up = c_xz * bx + c_yz * by + c_zz * bz;
    const floats least = MIN_START_Z * sqrt(x * x + y * y + up * up), tiny = MIN_LENGTH;
    const floats at_least = MORE_OF(least, tiny), z = MORE_OF(up, at_least);
    *p = -x / z;
    *q = -y / z;
}

// Bit k-1 is set where an LED's light, less what the gel diffuses, is below half of what it should be.
static ints shaded(
    const floats *image, const floats *m, const floats terms[][MODEL_TERMS],
    __global const float *dark, const floats g, const int K)
{
    const floats none = 0.0f, one = 1.0f;
    ints labels = 0;
    for (int k = 0; k < K; ++k) {
        floats x, y, z;
        const floats at_rest = modelled_light(terms[k], none, none, one, &x, &y, &z);
        const floats faint = MIN_EXPECTED_SHARE * (at_rest - dark[k]), direct = m[k] - dark[k];
        const floats least = g * (dark[k] + 0.5f * MORE_OF(direct, faint));
        labels |= image[k] < least ? (ints)(1 << k) : (ints)0;
    }
    return labels;
}

// Slope and brightness of a pixel from all LEDs, by a light model.
LANED __kernel void light_model_slope(
    __global const PIXEL *restrict light,
    __global const float *restrict model_quadratic,
    __global const float *restrict model_linear,
    __global const float *restrict model_u,
    __global const float *restrict model_v,
    const float model_degree,
    __global const float *restrict model_dark,
    __global const float *restrict model_gain,
    __global float *restrict slope,
    __global float *restrict brightness,
    __global float *restrict residual,
    __global uchar *restrict shadow,
    const int K, const int H, const int W,
    const int steps)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, i = row * W + column;
    const floats least = MIN_LIGHT, smallest = MIN_DETERMINANT, none = 0.0f, one = 1.0f;
    const floats u = load_floats(model_u + column, count), v = model_v[row];

    floats image[MAX_LEDS], terms[MAX_LEDS][MODEL_TERMS], powers[MAX_MONOMIALS], p, q;
    for (int k = 0; k < K; ++k) {
        image[k] = load_fractions(light + k * size + i, count);
        if (model_gain) image[k] *= load_floats(model_gain + k * size + i, count);
    }
    const int there = monomials(powers, u, v, (int)model_degree);
    linear_slope(image, model_linear, powers, there, K, &p, &q);
    for (int k = 0; k < K; ++k)
        for (int t = 0; t < MODEL_TERMS; ++t)
            terms[k][t] = coefficient(model_quadratic + (MODEL_TERMS * k + t) * MAX_MONOMIALS,
                powers, there);

    floats g, m[MAX_LEDS];
    ints moving = -1;
    for (int step = 0;; ++step) {
        const floats square = one + p * p + q * q, w = one / sqrt(square), cube = w / square;
        const floats x = -p * w, y = -q * w;
        const floats xp = p * p * cube - w, xy = p * q * cube, zp = -p * cube;
        const floats yq = q * q * cube - w, zq = -q * cube;
        floats jp[MAX_LEDS], jq[MAX_LEDS];
        floats shown = 0.0f, norm = 0.0f, share_p = 0.0f, share_q = 0.0f;
        for (int k = 0; k < K; ++k) {
            floats gx, gy, gz;
            m[k] = modelled_light(terms[k], x, y, w, &gx, &gy, &gz);
            jp[k] = gx * xp + gy * xy + gz * zp;
            jq[k] = gx * xy + gy * yq + gz * zq;
            shown += m[k] * image[k];
            norm += m[k] * m[k];
            share_p += m[k] * jp[k];
            share_q += m[k] * jq[k];
        }
        norm += least;
        g = shown / norm;
        if (step == steps || !ANY(moving)) break;
        share_p /= norm;
        share_q /= norm;
        floats a = 0.0f, b = 0.0f, c = 0.0f, s = 0.0f, t = 0.0f;
        for (int k = 0; k < K; ++k) {
            const floats by_p = g * (jp[k] - m[k] * share_p), by_q = g * (jq[k] - m[k] * share_q);
            const floats rest = image[k] - g * m[k];
            a += by_p * by_p;
            b += by_p * by_q;
            c += by_q * by_q;
            s += by_p * rest;
            t += by_q * rest;
        }
        const floats raw = a * c - b * b, determinant = MORE_OF(raw, smallest);
        const floats dp = (c * s - b * t) / determinant, dq = (a * t - b * s) / determinant;
        const floats length_ = sqrt(dp * dp + dq * dq), longest = MAX_TURN_RAD * square;
        const floats shrink = ANY(length_ > longest)
            ? LESS_OF(longest / MORE_OF(length_, smallest), one) : one;
        p += moving ? dp * shrink : none;
        q += moving ? dq * shrink : none;
        moving = moving && length_ > MIN_STEP_RAD * square;
    }
    floats squares = 0.0f;
    for (int k = 0; k < K; ++k) {
        const floats rest = image[k] - g * m[k];
        squares += rest * rest;
    }
    store_floats(p, slope + i, count);
    store_floats(q, slope + size + i, count);
    store_floats(g, brightness + i, count);
    store_floats(sqrt(squares / (float)K), residual + i, count);
    store_bytes(shaded(image, m, terms, model_dark, g, K), shadow + i, count);
}
