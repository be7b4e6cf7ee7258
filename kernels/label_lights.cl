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

typedef struct {
    float3 normal, twin;
} Normals;

#define NUMBERS (int8)(0, 1, 2, 3, 4, 5, 6, 7)

static float sum(const float8 a)
{
    return ((a.s0 + a.s1) + (a.s2 + a.s3)) + ((a.s4 + a.s5) + (a.s6 + a.s7));
}

// Both arguments are vectors: oclgrind reads beyond the number in fmax(vector, number), and
// fails on narrowing shuffles such as a.lo.
static float8 at_least(const float8 a, const float least)
{
    return fmax(a, (float8)(least));
}

// 1 in the lanes of a set's LEDs, else 0.
static float8 lanes(const int set)
{
    return convert_float8((int8)(set) >> NUMBERS & 1);
}

// The set of the LEDs whose lanes are true (-1).
static int set_of(const int8 flags)
{
    const int8 bits = flags & ((int8)(1) << NUMBERS);
    return bits.s0 | bits.s1 | bits.s2 | bits.s3 | bits.s4 | bits.s5 | bits.s6 | bits.s7;
}

static float dot_(const float3 a, const float3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// The light that each LED gives a film with normal n.
static float8 shine(const Pixel *pixel, const float3 n)
{
    return pixel->x * n.x + pixel->y * n.y + pixel->z * n.z;
}

static float3 unit(const float3 n)
{
    return n / (sqrt(dot_(n, n)) + TINY);
}

static float3 visible(const float3 n)
{
    return (float3)(n.x, n.y, fmax(n.z, FLATTEST));
}

// Direction of the unweighted linear solution, by the adjugate.
static float3 linear(const Pixel *pixel, const int used)
{
    const float8 on = lanes(used);
    const float8 x = pixel->x * on, y = pixel->y * on, z = pixel->z * on;
    const float xx = sum(x * x), xy = sum(x * y), xz = sum(x * z);
    const float yy = sum(y * y), yz = sum(y * z), zz = sum(z * z);
    const float3 b = (float3)(sum(x * pixel->light), sum(y * pixel->light), sum(z * pixel->light));
    const float c00 = yy * zz - yz * yz, c01 = xz * yz - xy * zz, c02 = xy * yz - xz * yy;
    const float c11 = xx * zz - xz * xz, c12 = xy * xz - xx * yz, c22 = xx * yy - xy * xy;
    return (float3)(c00 * b.x + c01 * b.y + c02 * b.z, c01 * b.x + c11 * b.y + c12 * b.z,
                    c02 * b.x + c12 * b.y + c22 * b.z);
}

// One weighted step in the tangent plane, n + a (n_z, 0, -n_x) + b (0, n_z, -n_y).
static float3 gauss_newton(const Pixel *pixel, const float8 weight, const float3 n)
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
    return visible((float3)(n.x + a * n.z, n.y + b * n.z, n.z - a * n.x - b * n.y));
}

// The unit normal from three LEDs or more.
static float3 least_squares(const Pixel *pixel, const int used)
{
    const float8 weight = pixel->weight * lanes(used);
    float3 normal = visible(unit(linear(pixel, used)));
    for (int step = 0; step < STEPS; ++step)
        normal = gauss_newton(pixel, weight, unit(normal));
    return unit(normal);
}

// The light that LEDs called dark would give; plenty for a normal the camera cannot see.
static float lit_behind(const Pixel *pixel, const int used, const float3 n)
{
    const float total = n.z < 0.05f ? 10.0f : 0.0f;
    return total + sum(at_least(shine(pixel, n), 0.0f) * lanes(~used));
}

// The vector of equation N1 of an LED that is alone in a set, and its light.
static float4 led_of(const Pixel *pixel, const int set)
{
    const float8 on = lanes(set);
    return (float4)(sum(pixel->x * on), sum(pixel->y * on), sum(pixel->z * on),
                    sum(pixel->light * on));
}

// The two unit normals that two LEDs allow, the likelier first.
static Normals pair_of(const Pixel *pixel, const int used, const int attached, const float3 prior)
{
    const int one = used & -used;
    const float4 i = led_of(pixel, one), j = led_of(pixel, used & ~one);
    const float3 u = (float3)(i.x, i.y, i.z), v = (float3)(j.x, j.y, j.z);
    const float3 across = (float3)(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z,
                                   u.x * v.y - u.y * v.x);
    const float uu = dot_(u, u), uv = dot_(u, v), vv = dot_(v, v);
    const float determinant = fmax(uu * vv - uv * uv, 1e-9f);
    const float s = (vv * i.w - uv * j.w) / determinant, t = (uu * j.w - uv * i.w) / determinant;
    const float3 base = u * s + v * t;
    const float beyond = sqrt(fmax(1.0f - dot_(base, base), 0.0f) / determinant);
    const float3 first = unit(base + across * beyond), second = unit(base - across * beyond);
    int take = first.z >= second.z;
    if (fmax(first.z, second.z) <= AT_REST) {
        if (attached) {
            const float a = lit_behind(pixel, used, first), b = lit_behind(pixel, used, second);
            if (fabs(a - b) >= ALIKE) take = a < b;
        } else {
            take = dot_(first, prior) >= dot_(second, prior);
        }
    }
    Normals found = {visible(take ? first : second), visible(take ? second : first)};
    return found;
}

// The next larger number with as many bits set.
static int next_set(const int bits)
{
    const int lowest = bits & -bits, ripple = bits + lowest;
    return ripple | ((1 << (popcount(bits ^ ripple) - 2)) - 1);
}

static float2 slope_of(const float3 n, const float steepest)
{
    const float z = fmax(n.z, 1.0f / steepest);
    return (float2)(-n.x / z, -n.y / z);
}

// Variance of p and q: (J' W J)^-1 of the tangent plane, carried to the slope.
static float2 variance_of(const Pixel *pixel, const int used, const float3 n, const float2 slope)
{
    const float8 j1 = pixel->x * n.z - pixel->z * n.x, j2 = pixel->y * n.z - pixel->z * n.y;
    const float8 w = pixel->weight * lanes(used), w1 = w * j1;
    const float h11 = sum(w1 * j1), h12 = sum(w1 * j2), h22 = sum(w * j2 * j2);
    const float determinant = h11 * h22 - h12 * h12;
    if (!(determinant > SINGULAR * h11 * h22)) return UNKNOWN;
    const float p = slope.x, q = slope.y;
    const float a = 1.0f + p * p, b = p * q, c = 1.0f + q * q;
    return (float2)(a * a * h22 - 2.0f * a * b * h12 + b * b * h11,
                    b * b * h22 - 2.0f * b * c * h12 + c * c * h11) / determinant;
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
    const float3 believed = (float3)(-prior[at], -prior[size + at], 1.0f);
    const float8 on = lanes(all);
    const Led8 leds = {gather(lights, 3, K), gather(lights + 1, 3, K), gather(lights + 2, 3, K)};
    const Led8 vectors = light_vectors(leds, place(x, W, pixel), place(y, H, pixel), height[at]);
    Pixel here = {gather(light + at, size, K) * on, at_least(gather(sigma + at, size, K), 1e-5f)};
    here.weight = on / (here.sigma * here.sigma);
    here.x = vectors.x * on;
    here.y = vectors.y * on;
    here.z = vectors.z * on;
    const int below = set_of(here.light < floor_ * here.sigma) & all;
    const int forced = dark > 0 ? below : 0;
    float best = INFINITY, best_misfit = 0.0f;
    int best_used = 0;
    Normals chosen = {(float3)(0.0f, 0.0f, 1.0f), (float3)(0.0f, 0.0f, 1.0f)};
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
    const int dim = set_of(here.light < 0.5f * due) & all;
    const float2 found = slope_of(chosen.normal, steepest);
    const float2 other = slope_of(chosen.twin, steepest);
    const float2 spread = variance_of(&here, best_used, chosen.normal, found);
    slope[at] = found.x;
    slope[size + at] = found.y;
    twin[at] = other.x;
    twin[size + at] = other.y;
    variance[at] = spread.x;
    variance[size + at] = spread.y;
    used[at] = best_used;
    shadow[at] = best_used ? dim & ~best_used : forced;
    misfit[at] = best_misfit;
}
