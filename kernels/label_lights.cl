#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MOST 8
#define STEPS 1
#define LONGEST 0.3f
#define AT_REST 0.999f
#define ALIKE 0.02f
#define MILD 0.01f
#define SINGULAR 1e-4f
#define FAINTEST 0.08f
#define STRAY 0.015f
#define SHADE 0.1f
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

// A symmetric matrix.
typedef struct {
    floats xx, xy, xz, yy, yz, zz;
} Symmetric;

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

static Vector scaled(const Vector n, const floats by)
{
    const Vector s = {n.x * by, n.y * by, n.z * by};
    return s;
}

static Vector unit(const Vector n)
{
    return scaled(n, 1.0f / (sqrt(dot_(n, n)) + TINY));
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

static Vector times_(const Symmetric a, const Vector b)
{
    const Vector c = {a.xx * b.x + a.xy * b.y + a.xz * b.z, a.xy * b.x + a.yy * b.y + a.yz * b.z,
                      a.xz * b.x + a.yz * b.y + a.zz * b.z};
    return c;
}

// Direction of the solution of a symmetric 3 x 3 system, by the adjugate.
static Vector solution(const Symmetric a, const Vector b)
{
    const Symmetric adjugate = {
        a.yy * a.zz - a.yz * a.yz, a.xz * a.yz - a.xy * a.zz, a.xy * a.yz - a.xz * a.yy,
        a.xx * a.zz - a.xz * a.xz, a.xy * a.xz - a.xx * a.yz, a.xx * a.yy - a.xy * a.xy};
    return times_(adjugate, b);
}

// One step in the tangent plane, n + s (n_z, 0, -n_x) + t (0, n_z, -n_y), to a slope that
// noise does not bias; see nodes/label_lights.py.
static Vector gauss_newton(
    const Symmetric a, const Vector b, const floats scale, const Vector n)
{
    // The matrix times the first tangent, and what the second takes of its own product.
    const floats ux = a.xx * n.z - a.xz * n.x, uy = a.xy * n.z - a.yz * n.x;
    const floats uz = a.xz * n.z - a.zz * n.x;
    const floats vy = a.yy * n.z - a.yz * n.y, vz = a.yz * n.z - a.zz * n.y;
    const floats h11 = ux * n.z - uz * n.x, h12 = uy * n.z - uz * n.y, h22 = vy * n.z - vz * n.y;
    const floats trace = h11 + h22;
    const floats inverse = 1.0f / (h11 * h22 - h12 * h12 + 1e-6f * trace * trace + TINY);
    const floats g11 = n.z * n.z + n.x * n.x, g12 = n.x * n.y, g22 = n.z * n.z + n.y * n.y;
    const floats spread = scale * inverse * (h22 * g11 + h11 * g22 - (h12 + h12) * g12);
    const floats limit = MILD * n.z * n.z;
    const floats mild = limit / MORE_OF(spread, limit);
    const floats half_ = 0.5f * mild * spread, part = mild * scale, steep = 1.0f / n.z;
    const Vector an = times_(a, n);
    const floats u1 = an.x * n.z - an.z * n.x, u2 = an.y * n.z - an.z * n.y;
    const floats f1 = (h22 * u1 - h12 * u2) * inverse, f2 = (h11 * u2 - h12 * u1) * inverse;
    const floats g1 = b.x * n.z - b.z * n.x - u1 - half_ * u1
        - part * (g11 * f1 + g12 * f2 + n.x * steep);
    const floats g2 = b.y * n.z - b.z * n.y - u2 - half_ * u2
        - part * (g12 * f1 + g22 * f2 + n.y * steep);
    floats s = (h22 * g1 - h12 * g2) * inverse, t = (h11 * g2 - h12 * g1) * inverse;
    const floats shrink = LONGEST / at_least(LONGEST, sqrt(s * s + t * t));
    s *= shrink;
    t *= shrink;
    const Vector turned = {n.x + s * n.z, n.y + t * n.z, n.z - s * n.x - t * n.y};
    return turned;
}

// The unit normal from three LEDs or more: the normal equations are the sums of w v v' and of
// w m v, over the trace of the first so that products stay small.
static Vector least_squares(const Pixels *pixels, const int used)
{
    Symmetric a = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    Vector b = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < pixels->K; ++k)
        if (used >> k & 1) {
            const Vector v = pixels->vector[k], w = scaled(v, pixels->weight[k]);
            a.xx += w.x * v.x;
            a.xy += w.x * v.y;
            a.xz += w.x * v.z;
            a.yy += w.y * v.y;
            a.yz += w.y * v.z;
            a.zz += w.z * v.z;
            b.x += w.x * pixels->light[k];
            b.y += w.y * pixels->light[k];
            b.z += w.z * pixels->light[k];
        }
    const floats scale = 1.0f / (a.xx + a.yy + a.zz);
    const Symmetric over_trace = {a.xx * scale, a.xy * scale, a.xz * scale,
                                  a.yy * scale, a.yz * scale, a.zz * scale};
    b = scaled(b, scale);
    Vector normal = visible(unit(solution(over_trace, b)));
    for (int step = 0; step < STEPS; ++step)
        normal = unit(visible(gauss_newton(over_trace, b, scale, normal)));
    return normal;
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
    const floats flatter = -1.0f / at_least(1.0f / steepest, n.z);
    const Slope slope = {n.x * flatter, n.y * flatter};
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
    Vector believed = {0.0f, 0.0f, 1.0f};
    if (!pair) {
        believed.x = -load_floats(prior + at, count);
        believed.y = -load_floats(prior + size + at, count);
    }
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
                    const floats spread = sqrt(here.sigma[k] * here.sigma[k] + STRAY * STRAY);
                    const floats bright = at_least(0.0f, over / spread + one_sided);
                    const floats lit = here.light[k] * (1.0f / SHADE);
                    excess += (below & (1 << k)) != 0 ? none : bright * bright + lit * lit;
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
    if (slope) {
        store_floats(found.p, slope + at, count);
        store_floats(found.q, slope + size + at, count);
    }
    if (twin) {
        const Slope other = slope_of(best_normals.twin, steepest);
        store_floats(other.p, twin + at, count);
        store_floats(other.q, twin + size + at, count);
    }
    if (variance) {
        const Slope spread = variance_of(&here, best_used, best_normals.normal, found);
        store_floats(spread.p, variance + at, count);
        store_floats(spread.q, variance + size + at, count);
    }
    if (used) store_bytes(best_used, used + at, count);
    if (shadow) {
        ints dim = 0;
        if (ANY(best_used != all)) {
            dim = dim_of(&here, best_normals.normal) & ~best_used;
            dim = best_used == 0 ? forced : dim;
        }
        store_bytes(dim, shadow + at, count);
    }
    if (misfit) store_floats(best_misfit, misfit + at, count);
}
