#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MAX_LEDS 8
#define RIDGE_TRACE_SHARE 1e-6f
#define UNUSED_SIGMA 1e3f
#define NO_LED (-1)

// LANES pixels: light and weight of each LED, and the vectors of equation N1.
typedef struct {
    floats light[MAX_LEDS], weight[MAX_LEDS];
    Vector towards[MAX_LEDS];
} Observation;

// The factors L D L^T of a symmetric 3 x 3 matrix: 1 / D, then L.
typedef struct {
    floats first, second, third, yx, zx, zy;
} Moments;

typedef struct {
    Vector normal;
    Moments moments;
    floats misfit;
} Fit;

static floats length_of(const Vector a)
{
    const floats tiny = 1e-6f, length_ = sqrt(dot_of(a, a));
    return MORE_OF(length_, tiny);
}

// The inverse times a vector.
static Vector solve(const Moments m, const Vector right)
{
    floats y = right.y - m.yx * right.x;
    const floats z = (right.z - m.zx * right.x - m.zy * y) * m.third;
    y = y * m.second - m.zy * z;
    const Vector result = {right.x * m.first - m.yx * y - m.zx * z, y, z};
    return result;
}

// Least squares over all LEDs but one, then the nearest normal of unit length.
static Fit fit(const Observation *observed, const int K, const int without)
{
    const floats tiny = 1e-20f, thin = 1e-12f;
    floats xx = 0.0f, xy = 0.0f, xz = 0.0f, yy = 0.0f, yz = 0.0f, zz = 0.0f;
    Vector right = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < K; ++k) {
        if (k == without) continue;
        const floats weight = observed->weight[k], weighted = weight * observed->light[k];
        const Vector v = observed->towards[k];
        xx += weight * v.x * v.x;
        xy += weight * v.x * v.y;
        xz += weight * v.x * v.z;
        yy += weight * v.y * v.y;
        yz += weight * v.y * v.z;
        zz += weight * v.z * v.z;
        right.x += weighted * v.x;
        right.y += weighted * v.y;
        right.z += weighted * v.z;
    }
    const floats share = RIDGE_TRACE_SHARE * (xx + yy + zz), soft = MORE_OF(share, tiny);
    Fit result;
    Moments *m = &result.moments;
    m->first = 1.0f / (xx + soft);
    m->yx = xy * m->first;
    m->zx = xz * m->first;
    const floats second = yy + soft - m->yx * xy;
    m->second = 1.0f / MORE_OF(second, soft);
    m->zy = (yz - m->yx * xz) * m->second;
    const floats third = zz + soft - m->zx * xz - m->zy * (yz - m->yx * xz);
    m->third = 1.0f / MORE_OF(third, soft);

    const Vector free_ = solve(*m, right);
    const floats length_ = sqrt(dot_of(free_, free_)), divisor = length_of(free_);
    const Vector unit = {free_.x / divisor, free_.y / divisor, free_.z / divisor};
    const Vector along = solve(*m, unit);
    const floats spread = dot_of(unit, along);
    const floats over = (length_ - 1.0f) / MORE_OF(spread, thin);
    Vector n = {free_.x - along.x * over, free_.y - along.y * over, free_.z - along.z * over};
    const floats size = length_of(n);
    n.x /= size;
    n.y /= size;
    n.z /= size;
    result.normal = n;
    result.misfit = 0.0f;
    for (int k = 0; k < K; ++k) {
        if (k == without) continue;
        const floats away = observed->light[k] - dot_of(observed->towards[k], n);
        result.misfit += observed->weight[k] * away * away;
    }
    return result;
}

// The unit vector half-way between an LED and the camera above.
static Vector half_way(
    __global const float *led, const floats x, const floats y, const floats z)
{
    const Vector ray = {led[0] - x, led[1] - y, led[2] - z};
    const floats away = sqrt(dot_of(ray, ray));
    const Vector half_ = {ray.x / away, ray.y / away, ray.z / away + 1.0f};
    const floats size = sqrt(dot_of(half_, half_));
    const Vector result = {half_.x / size, half_.y / size, half_.z / size};
    return result;
}

// Mark the LED whose light exceeds what the others predict, where it could be mirrored.
LANED __kernel void label_highlights(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict lights,
    __global const float *restrict height,
    const float pixel,
    __global uchar *restrict highlight,
    __global float *restrict sigma_,
    const int K, const int H, const int W,
    const float doubt_chi2,
    const float fit_chi2,
    const float excess,
    const float lobe_deg)
{
    const int size = H * W;
    GRID_LANES(i, count, size)
    const floats least = 1e-10f, zero = 0.0f, z = load_floats(height + i, count);
    const float near = cos(lobe_deg * 0.017453293f);
    floats x, y, level = zero;
    Observation observed;
    places(i, H, W, pixel, &x, &y);
    for (int k = 0; k < K; ++k) {
        const floats noise = load_floats(sigma + k * size + i, count), square = noise * noise;
        observed.light[k] = load_floats(light + k * size + i, count);
        observed.weight[k] = 1.0f / MORE_OF(square, least);
        observed.towards[k] = light_vector(lights + 3 * k, x, y, z);
        const floats away = observed.light[k] - observed.towards[k].z;
        level += observed.weight[k] * away * away;
    }
    ints marked = 0, doubted = level > doubt_chi2;
    // If level film explains the light, so does the best normal.
    if (K > 3 && ANY(doubted)) doubted &= fit(&observed, K, NO_LED).misfit > doubt_chi2;
    if (K > 3 && ANY(doubted)) {
        floats best = INFINITY;
        for (int k = 0; k < K; ++k) {
            const Fit others = fit(&observed, K, k);
            const Vector towards = observed.towards[k];
            const floats noise = load_floats(sigma + k * size + i, count);
            const floats over = observed.light[k] - dot_of(towards, others.normal);
            const floats doubt = dot_of(towards, solve(others.moments, towards));
            const ints bright = over > excess * sqrt(noise * noise + doubt);
            const Vector half_ = half_way(lights + 3 * k, x, y, z);
            const ints facing = dot_of(half_, others.normal) > near;
            const ints better = others.misfit < best;
            const ints bit = 1 << k, none = 0;
            const ints result = (bright & facing & (others.misfit < fit_chi2)) ? bit : none;
            best = better ? others.misfit : best;
            marked = better ? result : marked;
        }
        const ints none = 0;
        marked = doubted ? marked : none;
    }
    store_bytes(marked, highlight + i, count);
    const floats unknown = UNUSED_SIGMA;
    for (int k = 0; k < K; ++k) {
        const floats noise = load_floats(sigma + k * size + i, count);
        store_floats((marked & (1 << k)) != 0 ? unknown : noise, sigma_ + k * size + i, count);
    }
}
