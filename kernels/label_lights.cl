#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MOST 8
#define STEPS 2
#define LONGEST 0.3f
#define AT_REST 0.999f
#define ALIKE 0.02f
#define SINGULAR 1e-4f
#define FAINTEST 0.02f
#define UNKNOWN 1e12f
#define TINY 1e-20f

// Pixels under all LEDs: light, its standard deviation, one over its variance, and the vectors
// of equation N1.
typedef struct {
    int K;
    floats light[MOST], sigma[MOST], weight[MOST];
    Vector vector[MOST];
} Pixels;

typedef struct {
    Vector normal, twin;
} Normals;

// Along x and along y.
typedef struct {
    floats p, q;
} Slope;

static floats dot_(const Vector a, const Vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// a s + b t
static Vector combined(const Vector a, const floats s, const Vector b, const floats t)
{
    const Vector c = {a.x * s + b.x * t, a.y * s + b.y * t, a.z * s + b.z * t};
    return c;
}

static Vector chosen_of(const ints first, const Vector a, const Vector b)
{
    const Vector c = {first ? a.x : b.x, first ? a.y : b.y, first ? a.z : b.z};
    return c;
}

static Vector unit(const Vector n)
{
    const floats length_ = sqrt(dot_(n, n)) + TINY;
    const Vector u = {n.x / length_, n.y / length_, n.z / length_};
    return u;
}

static floats at_least(const float least, const floats value)
{
    const floats low = least;
    return MORE_OF(value, low);
}

static Vector visible(const Vector n)
{
    const Vector v = {n.x, n.y, at_least(FLATTEST, n.z)};
    return v;
}

// Direction of the unweighted linear solution, by the adjugate.
static Vector linear(const Pixels *pixels, const int used)
{
    floats xx = 0.0f, xy = 0.0f, xz = 0.0f, yy = 0.0f, yz = 0.0f, zz = 0.0f;
    Vector b = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < pixels->K; ++k)
        if (used >> k & 1) {
            const Vector v = pixels->vector[k];
            xx += v.x * v.x;
            xy += v.x * v.y;
            xz += v.x * v.z;
            yy += v.y * v.y;
            yz += v.y * v.z;
            zz += v.z * v.z;
            b.x += v.x * pixels->light[k];
            b.y += v.y * pixels->light[k];
            b.z += v.z * pixels->light[k];
        }
    const floats c00 = yy * zz - yz * yz, c01 = xz * yz - xy * zz, c02 = xy * yz - xz * yy;
    const floats c11 = xx * zz - xz * xz, c12 = xy * xz - xx * yz, c22 = xx * yy - xy * xy;
    const Vector n = {c00 * b.x + c01 * b.y + c02 * b.z, c01 * b.x + c11 * b.y + c12 * b.z,
                      c02 * b.x + c12 * b.y + c22 * b.z};
    return n;
}

// One weighted step in the tangent plane, n + a (n_z, 0, -n_x) + b (0, n_z, -n_y).
static Vector gauss_newton(const Pixels *pixels, const int used, const Vector n)
{
    floats h11 = 0.0f, h12 = 0.0f, h22 = 0.0f, g1 = 0.0f, g2 = 0.0f;
    for (int k = 0; k < pixels->K; ++k)
        if (used >> k & 1) {
            const Vector v = pixels->vector[k];
            const floats w = pixels->weight[k];
            const floats j1 = v.x * n.z - v.z * n.x, j2 = v.y * n.z - v.z * n.y;
            const floats away = pixels->light[k] - dot_(v, n);
            h11 += w * j1 * j1;
            h12 += w * j1 * j2;
            h22 += w * j2 * j2;
            g1 += w * j1 * away;
            g2 += w * j2 * away;
        }
    const floats trace = h11 + h22;
    const floats determinant = h11 * h22 - h12 * h12 + 1e-6f * trace * trace + TINY;
    floats a = (h22 * g1 - h12 * g2) / determinant;
    floats b = (h11 * g2 - h12 * g1) / determinant;
    const floats shrink = at_least(1.0f, sqrt(a * a + b * b) / LONGEST);
    a /= shrink;
    b /= shrink;
    const Vector turned = {n.x + a * n.z, n.y + b * n.z, n.z - a * n.x - b * n.y};
    return visible(turned);
}

// The unit normal from three LEDs or more.
static Vector least_squares(const Pixels *pixels, const int used)
{
    Vector normal = visible(unit(linear(pixels, used)));
    for (int step = 0; step < STEPS; ++step)
        normal = gauss_newton(pixels, used, unit(normal));
    return unit(normal);
}

// The light that LEDs called dark would give; plenty for a normal the camera cannot see.
static floats lit_behind(const Pixels *pixels, const int used, const Vector n)
{
    const floats plenty = 10.0f, none = 0.0f;
    floats total = n.z < 0.05f ? plenty : none;
    for (int k = 0; k < pixels->K; ++k)
        if (!(used >> k & 1)) total += at_least(0.0f, dot_(pixels->vector[k], n));
    return total;
}

// The two unit normals that two LEDs allow, the likelier first.
static Normals pair_of(
    const Pixels *pixels, const int used, const int attached, const Vector prior)
{
    int i = -1, j = -1;
    for (int k = 0; k < pixels->K; ++k)
        if (used >> k & 1) {
            if (i < 0) i = k;
            j = k;
        }
    const Vector u = pixels->vector[i], v = pixels->vector[j];
    const Vector across = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    const floats uu = dot_(u, u), uv = dot_(u, v), vv = dot_(v, v);
    const floats determinant = at_least(1e-9f, uu * vv - uv * uv);
    const floats s = (vv * pixels->light[i] - uv * pixels->light[j]) / determinant;
    const floats t = (uu * pixels->light[j] - uv * pixels->light[i]) / determinant;
    const Vector base = combined(u, s, v, t);
    const floats beyond = sqrt(at_least(0.0f, 1.0f - dot_(base, base)) / determinant);
    const floats one = 1.0f;
    const Vector first = unit(combined(base, one, across, beyond));
    const Vector second = unit(combined(base, one, across, -beyond));
    const ints flatter = first.z >= second.z;
    ints take;
    if (attached) {
        const floats a = lit_behind(pixels, used, first), b = lit_behind(pixels, used, second);
        take = fabs(a - b) < ALIKE ? flatter : a < b;
    } else {
        take = dot_(first, prior) >= dot_(second, prior);
    }
    take = MORE_OF(first.z, second.z) > AT_REST ? flatter : take;
    const Normals found = {visible(chosen_of(take, first, second)),
                           visible(chosen_of(take, second, first))};
    return found;
}

// The next larger number with as many bits set.
static int next_set(const int bits)
{
    const int lowest = bits & -bits, ripple = bits + lowest;
    return ripple | ((1 << (popcount(bits ^ ripple) - 2)) - 1);
}

static Slope slope_of(const Vector n, const float steepest)
{
    const floats z = at_least(1.0f / steepest, n.z);
    const Slope slope = {-n.x / z, -n.y / z};
    return slope;
}

// Variance of p and q: (J' W J)^-1 of the tangent plane, carried to the slope.
static Slope variance_of(const Pixels *pixels, const ints used, const Vector n, const Slope slope)
{
    const floats none = 0.0f, unknown = UNKNOWN;
    floats h11 = 0.0f, h12 = 0.0f, h22 = 0.0f;
    for (int k = 0; k < pixels->K; ++k) {
        const Vector v = pixels->vector[k];
        const floats w = (used & (1 << k)) != 0 ? pixels->weight[k] : none;
        const floats j1 = v.x * n.z - v.z * n.x, j2 = v.y * n.z - v.z * n.y;
        h11 += w * j1 * j1;
        h12 += w * j1 * j2;
        h22 += w * j2 * j2;
    }
    const floats determinant = h11 * h22 - h12 * h12;
    const ints known = determinant > SINGULAR * h11 * h22;
    const floats a = 1.0f + slope.p * slope.p, b = slope.p * slope.q;
    const floats c = 1.0f + slope.q * slope.q;
    const floats by_p = (a * a * h22 - 2.0f * a * b * h12 + b * b * h11) / determinant;
    const floats by_q = (b * b * h22 - 2.0f * b * c * h12 + c * c * h11) / determinant;
    const Slope variance = {known ? by_p : unknown, known ? by_q : unknown};
    return variance;
}

// The LEDs whose light is not there.
static ints dim_of(const Pixels *pixels, const Vector n)
{
    const ints nothing = 0;
    ints dim = 0;
    for (int k = 0; k < pixels->K; ++k) {
        const ints bit = 1 << k;
        const floats due = at_least(FAINTEST, dot_(pixels->vector[k], n));
        dim |= pixels->light[k] < 0.5f * due ? bit : nothing;
    }
    return dim;
}

// The set of LEDs that explains a pixel best, and the slope that follows.
__kernel void label_lights(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict lights,
    __global const float *restrict height,
    __global const float *restrict prior,
    const float pixel,
    __global float *restrict slope,
    __global float *restrict twin,
    __global float *restrict variance,
    __global uchar *restrict used,
    __global uchar *restrict shadow,
    __global float *restrict misfit,
    const int K, const int H, const int W,
    const int pair,
    const int dark,
    const float floor_,
    const float price,
    const float one_sided,
    const float steepest)
{
    GRID_LANES(at, count, H * W)
    const int size = H * W, all = (1 << K) - 1;
    const floats none = 0.0f;
    const ints nothing = 0;
    floats x, y;
    places(at, H, W, pixel, &x, &y);
    const floats z = load_floats(height + at, count);
    const Vector believed = {-load_floats(prior + at, count),
                             -load_floats(prior + size + at, count), 1.0f};
    Pixels here;
    here.K = K;
    ints below = 0;
    for (int k = 0; k < K; ++k) {
        const ints bit = 1 << k;
        here.light[k] = load_floats(light + k * size + at, count);
        here.sigma[k] = at_least(1e-5f, load_floats(sigma + k * size + at, count));
        here.weight[k] = 1.0f / (here.sigma[k] * here.sigma[k]);
        here.vector[k] = light_vector(lights + 3 * k, x, y, z);
        below |= here.light[k] < floor_ * here.sigma[k] ? bit : nothing;
    }
    const ints forced = dark > 0 ? below : nothing, most = popcount(forced) + dark;
    floats best = INFINITY, best_misfit = 0.0f;
    ints best_used = 0;
    Normals best_normals = {{0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 1.0f}};
    for (int number = 0; number <= K - 2 && ANY(best > price * number); ++number) {
        for (int out = (1 << number) - 1; out <= all; out = number ? next_set(out) : all + 1) {
            const ints open = (best > price * number) & (most >= number) & ((forced & ~out) == 0);
            if (!ANY(open)) continue;
            const int lit = all & ~out;
            Normals tried;
            if (number < K - 2) tried.normal = tried.twin = least_squares(&here, lit);
            else tried = pair_of(&here, lit, pair, believed);
            floats squares = 0.0f, excess = 0.0f;
            for (int k = 0; k < K; ++k) {
                const floats predicted = dot_(here.vector[k], tried.normal);
                if (lit >> k & 1) {
                    const floats away = here.light[k] - predicted;
                    squares += here.weight[k] * away * away;
                } else {
                    const floats over = here.light[k] - at_least(0.0f, predicted);
                    const floats bright = at_least(0.0f, over / here.sigma[k] + one_sided);
                    excess += (below & (1 << k)) != 0 ? none : bright * bright;
                }
            }
            const floats cost = squares + price * number + excess;
            const ints better = open & (cost < best);
            const ints labels = lit;
            best = better ? cost : best;
            best_misfit = better ? squares : best_misfit;
            best_used = better ? labels : best_used;
            best_normals.normal = chosen_of(better, tried.normal, best_normals.normal);
            best_normals.twin = chosen_of(better, tried.twin, best_normals.twin);
        }
    }
    const Slope found = slope_of(best_normals.normal, steepest);
    const Slope other = slope_of(best_normals.twin, steepest);
    const Slope spread = variance_of(&here, best_used, best_normals.normal, found);
    const ints dim = dim_of(&here, best_normals.normal) & ~best_used;
    store_floats(found.p, slope + at, count);
    store_floats(found.q, slope + size + at, count);
    store_floats(other.p, twin + at, count);
    store_floats(other.q, twin + size + at, count);
    store_floats(spread.p, variance + at, count);
    store_floats(spread.q, variance + size + at, count);
    store_bytes(best_used, used + at, count);
    store_bytes(best_used == 0 ? forced : dim, shadow + at, count);
    store_floats(best_misfit, misfit + at, count);
}
