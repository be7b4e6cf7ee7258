// Equations M1 and M2 of docs/model.md.
#include "common.clh"
#include "lanes.clh"

#define SHADE_COUNT 9
#define PLACE_DEGREE 4
#define PLACE_TERMS 15
#define LIGHTS 8
#define POWERS (PLACE_DEGREE + 1)

// Along a row a coefficient is a polynomial in u alone, of POWERS numbers.  A work-item does one.
__kernel void polynomials_of_rows(
    __global const float *restrict reflectance,
    __global float *restrict rows,
    const int K, const int H, const int W)
{
    GRID_1(i, H * K * SHADE_COUNT)
    const int row = i / (K * SHADE_COUNT), coefficient = i - row * (K * SHADE_COUNT);
    const float v = ((float)row - 0.5f * (float)(H - 1)) * (2.0f / (float)W);
    // The monomials of degree d are u^d, u^(d-1) v, ..., v^d.
    __global const float *map = reflectance + coefficient * PLACE_TERMS;
    for (int power = 0; power < POWERS; ++power) {
        float sum = 0.0f;
        for (int degree = PLACE_DEGREE; degree >= power; --degree)
            sum = sum * v + map[degree * (degree + 1) / 2 + degree - power];
        rows[i * POWERS + power] = sum;
    }
}

static floats at_place(__global const float *polynomial, const floats u)
{
    floats sum = polynomial[PLACE_DEGREE];
    for (int power = PLACE_DEGREE - 1; power >= 0; --power) sum = sum * u + polynomial[power];
    return sum;
}

// Gauss-Newton for the slope that explains the light under a reflectance that varies.  A
// work-item does LANES pixels of a row.  Its steps wait for divisions and roots, so lengths are
// compared by their squares.
LANED __kernel void solve(
    __global const float *restrict light,
    __global const float *restrict flat,
    __global const float *restrict height,
    __global const float *restrict rows,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int steps,
    const float prior,
    const float max_turn_rad,
    const float still)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, at = row * W + column;
    const floats u = ((float)column + LANE_NUMBERS - 0.5f * (float)(W - 1)) * (2.0f / (float)W);
    __global const float *polynomials = rows + row * K * SHADE_COUNT * POWERS;
    floats coefficients[LIGHTS][SHADE_COUNT], rest[LIGHTS], weight[LIGHTS];
    for (int k = 0; k < K; ++k) {
        for (int b = 0; b < SHADE_COUNT; ++b)
            coefficients[k][b] = at_place(polynomials + (k * SHADE_COUNT + b) * POWERS, u);
        const floats lifted = coefficients[k][SHADE_COUNT - 1] * load_floats(height + at, count);
        rest[k] = load_floats(light + k * size + at, count) - 1.0f - lifted;
        weight[k] = load_floats(flat + k * size + at, count);
    }
    const floats none = 0.0f, dark = -1.0f;
    floats p = none, q = none;
    ints moving = -1;
    for (int step = 0; step < steps; ++step) {
        const floats square = 1.0f + p * p + q * q;
        const floats w = 1.0f / sqrt(square);
        const floats x = -p * w, y = -q * w, z = w;
        const floats cube = w * w * w;
        const floats xp = p * p * cube - w, yp = p * q * cube, zp = -p * cube;
        const floats xq = yp, yq = q * q * cube - w, zq = -q * cube;
        floats a = prior, b = none, c = prior, s = -prior * p, t = -prior * q;
        for (int k = 0; k < K; ++k) {
            const floats *l = coefficients[k];
            const floats value = l[0] * x + l[1] * y + l[2] * (z - 1.0f)
                + l[3] * (x * y) + l[4] * (x * z) + l[5] * (y * z)
                + l[6] * (x * x - y * y) + l[7] * (3.0f * (z * z - 1.0f));
            const floats rx = l[0] + l[3] * y + l[4] * z + 2.0f * l[6] * x;
            const floats ry = l[1] + l[3] * x + l[5] * z - 2.0f * l[6] * y;
            const floats rz = l[2] + l[4] * x + l[5] * y + 6.0f * l[7] * z;
            // Film that faces away from a light has none.
            const ints lit = value > dark;
            const floats jp = lit ? rx * xp + ry * yp + rz * zp : none;
            const floats jq = lit ? rx * xq + ry * yq + rz * zq : none;
            const floats residual = rest[k] - MORE_OF(value, dark);
            const floats wp = weight[k] * jp, wq = weight[k] * jq;
            a += wp * jp;
            b += wp * jq;
            c += wq * jq;
            s += wp * residual;
            t += wq * residual;
        }
        const floats smallest = 1e-12f, whole = 1.0f;
        floats determinant = a * c - b * b;
        determinant = MORE_OF(determinant, smallest);
        const floats inverse = 1.0f / determinant;
        const floats dp = (c * s - b * t) * inverse;
        const floats dq = (a * t - b * s) * inverse;
        const floats turned = dp * dp + dq * dq, longest = max_turn_rad * square, least = still * square;
        floats shrink = whole;
        if (ANY(turned > longest * longest)) {
            shrink = longest / sqrt(MORE_OF(turned, smallest));
            shrink = LESS_OF(shrink, whole);
        }
        p += moving ? dp * shrink : none;
        q += moving ? dq * shrink : none;
        moving = moving && turned > least * least;
        if (!ANY(moving)) break;
    }
    store_floats(p, out + at, count);
    store_floats(q, out + size + at, count);
}
