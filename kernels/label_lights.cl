#include "common.clh"
#include "near_light.clh"

#define STEPS 2
#define LONGEST 0.3f
#define AT_REST 0.999f
#define ALIKE 0.02f
#define SINGULAR 1e-4f
#define FAINTEST 0.02f
#define UNKNOWN 1e12f
#define TINY 1e-20f

// A pixel under all LEDs, one a lane: light, its standard deviation, one over its variance, and
// the vectors of equation N1.  Lanes without an LED hold zeros.
typedef struct {
    float8 light, sigma, weight;
    float8 x, y, z;
} Pixel;

// Not a float3: oclgrind fails on the shuffles that it implies.
typedef struct {
    float x, y, z;
} Vector;

typedef struct {
    Vector normal, twin;
} Normals;

// Along x and along y.
typedef struct {
    float p, q;
} Slope;

#define NUMBERS (int8)(0, 1, 2, 3, 4, 5, 6, 7)

static float sum(const float8 a)
{
    return ((a.s0 + a.s1) + (a.s2 + a.s3)) + ((a.s4 + a.s5) + (a.s6 + a.s7));
}

// Both arguments are vectors: oclgrind reads beyond the number in fmax(vector, number).  It
// also fails on a.lo and on comparing vectors, hence lane by lane above and below.
static float8 at_least(const float8 a, const float least)
{
    return fmax(a, (float8)(least));
}

// 1 in the lanes of a set's LEDs, else 0.
static float8 lanes(const int set)
{
    return convert_float8((int8)(set) >> NUMBERS & 1);
}

// The set of LEDs for which a is below b.
static int set_below(const float8 a, const float8 b)
{
    return (a.s0 < b.s0) | (a.s1 < b.s1) << 1 | (a.s2 < b.s2) << 2 | (a.s3 < b.s3) << 3
        | (a.s4 < b.s4) << 4 | (a.s5 < b.s5) << 5 | (a.s6 < b.s6) << 6 | (a.s7 < b.s7) << 7;
}

static float dot_(const Vector a, const Vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// a s + b t
static Vector combined(const Vector a, const float s, const Vector b, const float t)
{
    const Vector c = {a.x * s + b.x * t, a.y * s + b.y * t, a.z * s + b.z * t};
    return c;
}

// The light that each LED gives a film with normal n.
static float8 shine(const Pixel *pixel, const Vector n)
{
    return pixel->x * n.x + pixel->y * n.y + pixel->z * n.z;
}

static Vector unit(const Vector n)
{
    const float length_ = sqrt(dot_(n, n)) + TINY;
    const Vector u = {n.x / length_, n.y / length_, n.z / length_};
    return u;
}

static Vector visible(const Vector n)
{
    const Vector v = {n.x, n.y, fmax(n.z, FLATTEST)};
    return v;
}

// Direction of the unweighted linear solution, by the adjugate.
static Vector linear(const Pixel *pixel, const int used)
{
    const float8 on = lanes(used);
    const float8 x = pixel->x * on, y = pixel->y * on, z = pixel->z * on;
    const float xx = sum(x * x), xy = sum(x * y), xz = sum(x * z);
    const float yy = sum(y * y), yz = sum(y * z), zz = sum(z * z);
    const float bx = sum(x * pixel->light), by = sum(y * pixel->light), bz = sum(z * pixel->light);
    const float c00 = yy * zz - yz * yz, c01 = xz * yz - xy * zz, c02 = xy * yz - xz * yy;
    const float c11 = xx * zz - xz * xz, c12 = xy * xz - xx * yz, c22 = xx * yy - xy * xy;
    const Vector n = {c00 * bx + c01 * by + c02 * bz, c01 * bx + c11 * by + c12 * bz,
                      c02 * bx + c12 * by + c22 * bz};
    return n;
}

// One weighted step in the tangent plane, n + a (n_z, 0, -n_x) + b (0, n_z, -n_y).
static Vector gauss_newton(const Pixel *pixel, const float8 weight, const Vector n)
{
    const float8 j1 = pixel->x * n.z - pixel->z * n.x, j2 = pixel->y * n.z - pixel->z * n.y;
    const float8 away = pixel->light - shine(pixel, n);
    const float8 w1 = weight * j1, w2 = weight * j2;
    const float h11 = sum(w1 * j1), h12 = sum(w1 * j2), h22 = sum(w2 * j2);
    const float g1 = sum(w1 * away), g2 = sum(w2 * away);
    const float trace = h11 + h22;
    const float determinant = h11 * h22 - h12 * h12 + 1e-6f * trace * trace + TINY;
    float a = (h22 * g1 - h12 * g2) / determinant;
    float b = (h11 * g2 - h12 * g1) / determinant;
    const float shrink = fmax(1.0f, sqrt(a * a + b * b) / LONGEST);
    a /= shrink;
    b /= shrink;
    const Vector turned = {n.x + a * n.z, n.y + b * n.z, n.z - a * n.x - b * n.y};
    return visible(turned);
}

// The unit normal from three LEDs or more.
static Vector least_squares(const Pixel *pixel, const int used)
{
    const float8 weight = pixel->weight * lanes(used);
    Vector normal = visible(unit(linear(pixel, used)));
    for (int step = 0; step < STEPS; ++step)
        normal = gauss_newton(pixel, weight, unit(normal));
    return unit(normal);
}

// The light that LEDs called dark would give; plenty for a normal the camera cannot see.
static float lit_behind(const Pixel *pixel, const int used, const Vector n)
{
    const float total = n.z < 0.05f ? 10.0f : 0.0f;
    return total + sum(at_least(shine(pixel, n), 0.0f) * lanes(~used));
}

// The vector of equation N1 of an LED that is alone in a set.
static Vector vector_of(const Pixel *pixel, const int set)
{
    const float8 on = lanes(set);
    const Vector v = {sum(pixel->x * on), sum(pixel->y * on), sum(pixel->z * on)};
    return v;
}

// The two unit normals that two LEDs allow, the likelier first.
static Normals pair_of(const Pixel *pixel, const int used, const int attached, const Vector prior)
{
    const int one = used & -used;
    const Vector u = vector_of(pixel, one), v = vector_of(pixel, used & ~one);
    const float i = sum(pixel->light * lanes(one)), j = sum(pixel->light * lanes(used & ~one));
    const Vector across = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    const float uu = dot_(u, u), uv = dot_(u, v), vv = dot_(v, v);
    const float determinant = fmax(uu * vv - uv * uv, 1e-9f);
    const float s = (vv * i - uv * j) / determinant, t = (uu * j - uv * i) / determinant;
    const Vector base = combined(u, s, v, t);
    const float beyond = sqrt(fmax(1.0f - dot_(base, base), 0.0f) / determinant);
    const Vector first = unit(combined(base, 1.0f, across, beyond));
    const Vector second = unit(combined(base, 1.0f, across, -beyond));
    int take = first.z >= second.z;
    if (fmax(first.z, second.z) <= AT_REST) {
        if (attached) {
            const float a = lit_behind(pixel, used, first), b = lit_behind(pixel, used, second);
            if (fabs(a - b) >= ALIKE) take = a < b;
        } else {
            take = dot_(first, prior) >= dot_(second, prior);
        }
    }
    const Normals found = {visible(take ? first : second), visible(take ? second : first)};
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
    const float z = fmax(n.z, 1.0f / steepest);
    const Slope slope = {-n.x / z, -n.y / z};
    return slope;
}

// Variance of p and q: (J' W J)^-1 of the tangent plane, carried to the slope.
static Slope variance_of(const Pixel *pixel, const int used, const Vector n, const Slope slope)
{
    const float8 j1 = pixel->x * n.z - pixel->z * n.x, j2 = pixel->y * n.z - pixel->z * n.y;
    const float8 w = pixel->weight * lanes(used), w1 = w * j1;
    const float h11 = sum(w1 * j1), h12 = sum(w1 * j2), h22 = sum(w * j2 * j2);
    const float determinant = h11 * h22 - h12 * h12;
    const int known = determinant > SINGULAR * h11 * h22;
    const float a = 1.0f + slope.p * slope.p, b = slope.p * slope.q, c = 1.0f + slope.q * slope.q;
    const float by_p = (a * a * h22 - 2.0f * a * b * h12 + b * b * h11) / determinant;
    const float by_q = (b * b * h22 - 2.0f * b * c * h12 + c * c * h11) / determinant;
    const Slope variance = {known ? by_p : UNKNOWN, known ? by_q : UNKNOWN};
    return variance;
}

// A value per LED of an array, `stride` apart; lanes beyond K repeat the last one.
static float8 gather(__global const float *first, const int stride, const int K)
{
    const int8 at = min(NUMBERS, (int8)(K - 1)) * stride;
    return (float8)(first[at.s0], first[at.s1], first[at.s2], first[at.s3],
                    first[at.s4], first[at.s5], first[at.s6], first[at.s7]);
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
    GRID_2(y, x, H, W)
    const int size = H * W, at = y * W + x, all = (1 << K) - 1;
    const Vector believed = {-prior[at], -prior[size + at], 1.0f};
    const float8 on = lanes(all);
    const Led8 leds = {gather(lights, 3, K), gather(lights + 1, 3, K), gather(lights + 2, 3, K)};
    const Led8 vectors = light_vectors(leds, place(x, W, pixel), place(y, H, pixel), height[at]);
    Pixel here = {gather(light + at, size, K) * on, at_least(gather(sigma + at, size, K), 1e-5f)};
    here.weight = on / (here.sigma * here.sigma);
    here.x = vectors.x * on;
    here.y = vectors.y * on;
    here.z = vectors.z * on;
    const int below = set_below(here.light, floor_ * here.sigma) & all;
    const int forced = dark > 0 ? below : 0;
    float best = INFINITY, best_misfit = 0.0f;
    int best_used = 0;
    Normals chosen = {{0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 1.0f}};
    const int most = min(K - 2, popcount(forced) + dark);
    for (int number = popcount(forced); number <= most && best > price * number; ++number) {
        for (int out = (1 << number) - 1; out <= all; out = number ? next_set(out) : all + 1) {
            if (forced & ~out) continue;
            const int lit = all & ~out;
            Normals tried;
            if (number < K - 2) tried.normal = tried.twin = least_squares(&here, lit);
            else tried = pair_of(&here, lit, pair, believed);
            const float8 predicted = shine(&here, tried.normal);
            const float8 away = here.light - predicted;
            const float8 over = here.light - at_least(predicted, 0.0f);
            const float8 bright = at_least(over / here.sigma + one_sided, 0.0f);
            const float squares = sum(here.weight * lanes(lit) * away * away);
            const float excess = sum(bright * bright * lanes(out & ~below));
            const float cost = squares + price * number + excess;
            if (cost < best) {
                best = cost;
                best_misfit = squares;
                best_used = lit;
                chosen = tried;
            }
        }
    }
    const float8 due = at_least(shine(&here, chosen.normal), FAINTEST);
    const int dim = set_below(here.light, 0.5f * due) & all;
    const Slope found = slope_of(chosen.normal, steepest);
    const Slope other = slope_of(chosen.twin, steepest);
    const Slope spread = variance_of(&here, best_used, chosen.normal, found);
    slope[at] = found.p;
    slope[size + at] = found.q;
    twin[at] = other.p;
    twin[size + at] = other.q;
    variance[at] = spread.p;
    variance[size + at] = spread.q;
    used[at] = best_used;
    shadow[at] = best_used ? dim & ~best_used : forced;
    misfit[at] = best_misfit;
}
