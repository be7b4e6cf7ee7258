// Equations S1 to S4 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MAX_LEDS 8
#define MAX_TURN_RAD 0.3f
#define AT_REST 0.999f
#define MIN_TWIN_DIFFERENCE 0.02f
#define FULL_BIAS_VARIANCE 0.01f
#define MIN_SINE_SQUARED 1e-4f
#define MIN_EXPECTED_LIGHT 0.08f
#define STRAY_LIGHT 0.015f
#define MAX_SHADE_LIGHT 0.1f
#define MIN_EVEN_SHARE 0.05f
#define TIE_COST 1e-3f
#define ANY_BRIGHTNESS 1e3f
#define UNKNOWN_VARIANCE 1e12f
#define MIN_DIVISOR 1e-20f

// Vectors of LANES pixels processed together, because a long chain of operations waits less if
// others are under way; and vectors per work-item.
#if LANES == 1
#define RUN 1
#define SHARE 1
#else
#define RUN 4
#define SHARE 32
#endif

// Pixels under all LEDs: light, its standard deviation, the reciprocal of its variance, and the
// vectors of equation N1; the prior normal; the LEDs that certainly do not reach it, as bits, and
// those of them that must be left out.
typedef struct {
    int K;
    float wrap;
    floats light[MAX_LEDS], sigma[MAX_LEDS], weight[MAX_LEDS];
    Vector vector[MAX_LEDS], believed;
    ints below, forced;
} Pixels;

typedef struct {
    Vector normal, twin;
} Normals;

typedef struct {
    Vector judged, normal;
} Judged;

// Along x and along y.
typedef struct {
    floats p, q;
} Slope;

// A symmetric matrix.
typedef struct {
    floats xx, xy, xz, yy, yz, zz;
} Symmetric;

// Sums of w v v' and of w m v, times `scale`, the reciprocal of the first one's trace, so that
// products stay small.
typedef struct {
    Symmetric a;
    Vector b;
    floats scale;
} Equations;

// The best so far: normals, the LEDs used, what the choice costs, and its sum of squares.
typedef struct {
    Normals normals;
    ints used;
    floats cost, misfit;
} Choice;

typedef struct {
    __global const float *light, *sigma, *lights, *height, *prior;
    float pixel;
    int K, H, W;
} Frame;

typedef struct {
    __global float *slope, *twin, *variance, *misfit;
    __global uchar *used, *shadow;
} Outputs;

typedef struct {
    int pair, dark;
    float floor_, price, one_sided, steepest, dimmed, uneven, wrap, turn;
} Rules;

// Pixels that another set of LEDs may explain better: the cost of all LEDs there, and a number that
// is the same for pixels with the same candidate sets.
typedef struct {
    int number, at[SHARE * LANES], kind[SHARE * LANES];
    float cost[SHARE * LANES];
} Doubtful;

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
    return scaled(n, 1.0f / (sqrt(dot_of(n, n)) + MIN_DIVISOR));
}

static floats at_least(const float least, const floats value)
{
    const floats low = least;
    return MORE_OF(value, low);
}

static Vector visible(const Vector n)
{
    const Vector v = {n.x, n.y, at_least(MIN_NORMAL_Z, n.z)};
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
// noise does not bias (S3); see nodes/optics/normals.py.
static Vector gauss_newton(
    const Symmetric a, const Vector b, const floats scale, const Vector n)
{
    // The matrix times the first tangent, and the needed part of the second's product.
    const floats ux = a.xx * n.z - a.xz * n.x, uy = a.xy * n.z - a.yz * n.x;
    const floats uz = a.xz * n.z - a.zz * n.x;
    const floats vy = a.yy * n.z - a.yz * n.y, vz = a.yz * n.z - a.zz * n.y;
    const floats h11 = ux * n.z - uz * n.x, h12 = uy * n.z - uz * n.y, h22 = vy * n.z - vz * n.y;
    const floats trace = h11 + h22;
    const floats inverse = 1.0f / (h11 * h22 - h12 * h12 + 1e-6f * trace * trace + MIN_DIVISOR);
    const floats g11 = n.z * n.z + n.x * n.x, g12 = n.x * n.y, g22 = n.z * n.z + n.y * n.y;
    const floats spread = scale * inverse * (h22 * g11 + h11 * g22 - (h12 + h12) * g12);
    const floats limit = FULL_BIAS_VARIANCE * n.z * n.z;
    floats mild = 1.0f;
    if (ANY(spread > limit)) mild = limit / MORE_OF(spread, limit);
    const floats half_ = 0.5f * mild * spread, part = mild * scale, steep = 1.0f / n.z;
    const Vector an = times_(a, n);
    const floats u1 = an.x * n.z - an.z * n.x, u2 = an.y * n.z - an.z * n.y;
    const floats f1 = (h22 * u1 - h12 * u2) * inverse, f2 = (h11 * u2 - h12 * u1) * inverse;
    const floats g1 = b.x * n.z - b.z * n.x - u1 - half_ * u1
        - part * (g11 * f1 + g12 * f2 + n.x * steep);
    const floats g2 = b.y * n.z - b.z * n.y - u2 - half_ * u2
        - part * (g12 * f1 + g22 * f2 + n.y * steep);
    floats s = (h22 * g1 - h12 * g2) * inverse, t = (h11 * g2 - h12 * g1) * inverse;
    const floats square = s * s + t * t;
    if (ANY(!(square <= MAX_TURN_RAD * MAX_TURN_RAD))) {
        const floats shrink = MAX_TURN_RAD / at_least(MAX_TURN_RAD, sqrt(square));
        s *= shrink;
        t *= shrink;
    }
    const Vector turned = {n.x + s * n.z, n.y + t * n.z, n.z - s * n.x - t * n.y};
    return turned;
}

static Equations normal_equations(const Pixels *pixels, const int used)
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
    const Equations system = {{a.xx * scale, a.xy * scale, a.xz * scale,
                             a.yy * scale, a.yz * scale, a.zz * scale}, scaled(b, scale), scale};
    return system;
}

static Vector linear(const Equations *system)
{
    return visible(unit(solution(system->a, system->b)));
}

static Vector step_from(const Equations *system, const Vector n)
{
    return unit(visible(gauss_newton(system->a, system->b, system->scale, n)));
}

// The normal equations near n, minus the part that the film's brightness explains.
static Equations at_any_brightness(const Equations *system, const Vector n, const float uneven)
{
    const Vector along = times_(system->a, n);
    const Vector taken = scaled(along, brightness_share(dot_of(n, along), system->scale, uneven));
    const floats nb = dot_of(n, system->b);
    const Symmetric a = system->a;
    const Vector b = system->b;
    const Equations less = {
        {a.xx - taken.x * along.x, a.xy - taken.x * along.y, a.xz - taken.x * along.z,
         a.yy - taken.y * along.y, a.yz - taken.y * along.z, a.zz - taken.z * along.z},
        {b.x - taken.x * nb, b.y - taken.y * nb, b.z - taken.z * nb},
        system->scale};
    return less;
}

// The unit normal by which a set of three LEDs or more is judged, and the one that it gives.
static Judged least_squares(const Equations *system, const int count, const float uneven)
{
    const Vector start = linear(system);
    const Equations free = at_any_brightness(system, start, uneven);
    const Vector normal = step_from(&free, start);
    const Judged result = {count > 3 ? normal : step_from(system, start), normal};
    return result;
}

// The light that the dark LEDs would give; plenty for a normal that the camera cannot see.
static floats lit_behind(const Pixels *pixels, const int used, const Vector n)
{
    const floats plenty = 10.0f, none = 0.0f;
    floats total = n.z < 0.05f ? plenty : none;
    for (int k = 0; k < pixels->K; ++k)
        if (!(used >> k & 1)) total += at_least(0.0f, dot_of(pixels->vector[k], n));
    return total;
}

// The two unit normals that two LEDs allow, the likelier first (S2).
static Normals pair_of(const Pixels *pixels, const int used, const int attached)
{
    int i = -1, j = -1;
    for (int k = 0; k < pixels->K; ++k)
        if (used >> k & 1) {
            if (i < 0) i = k;
            j = k;
        }
    const Vector u = pixels->vector[i], v = pixels->vector[j];
    const Vector across = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    const floats uu = dot_of(u, u), uv = dot_of(u, v), vv = dot_of(v, v);
    const floats determinant = at_least(1e-9f, uu * vv - uv * uv);
    const floats s = (vv * pixels->light[i] - uv * pixels->light[j]) / determinant;
    const floats t = (uu * pixels->light[j] - uv * pixels->light[i]) / determinant;
    const Vector base = combined(u, s, v, t);
    const floats beyond = sqrt(at_least(0.0f, 1.0f - dot_of(base, base)) / determinant);
    const floats one = 1.0f;
    const Vector first = unit(combined(base, one, across, beyond));
    const Vector second = unit(combined(base, one, across, -beyond));
    const ints flatter = first.z >= second.z;
    ints take;
    if (attached) {
        const floats a = lit_behind(pixels, used, first), b = lit_behind(pixels, used, second);
        take = fabs(a - b) < MIN_TWIN_DIFFERENCE ? flatter : a < b;
    } else {
        take = dot_of(first, pixels->believed) >= dot_of(second, pixels->believed);
    }
    take = MORE_OF(first.z, second.z) > AT_REST ? flatter : take;
    const Normals result = {visible(chosen_of(take, first, second)),
                           visible(chosen_of(take, second, first))};
    return result;
}

// The next larger number with the same number of bits set.
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

// Light above that of a shadow.
static floats shown_by(const Pixels *pixels, const floats light)
{
    if (pixels->wrap == 0.0f) return at_least(0.0f, light);
    return wrapped(light, pixels->wrap) + pixels->wrap;
}

// Variance of p and q: (J' W J)^-1 of the tangent plane, carried to the slope (S4).
static Slope variance_of(
    const Pixels *pixels, const ints used, const Vector n, const Slope slope, const float uneven)
{
    const floats none = 0.0f, one = 1.0f, unknown = UNKNOWN_VARIANCE;
    floats h11 = 0.0f, h12 = 0.0f, h22 = 0.0f, u1 = 0.0f, u2 = 0.0f, whole = 0.0f;
    const ints one_more = 1, nothing = 0;
    ints count = 0;
    for (int k = 0; k < pixels->K; ++k) {
        const Vector v = pixels->vector[k];
        const ints lit = (used & (1 << k)) != 0;
        const floats w = lit ? pixels->weight[k] : none;
        const floats shown = dot_of(v, n), weighted = w * shown;
        const floats j1 = v.x * n.z - v.z * n.x, j2 = v.y * n.z - v.z * n.y;
        h11 += w * j1 * j1;
        h12 += w * j1 * j2;
        h22 += w * j2 * j2;
        u1 += weighted * j1;
        u2 += weighted * j2;
        whole += weighted * shown;
        count += lit ? one_more : nothing;
    }
    const floats share = count > 2 ? brightness_share(whole, one, uneven) : none;
    h11 -= share * u1 * u1;
    h12 -= share * u1 * u2;
    h22 -= share * u2 * u2;
    const floats determinant = h11 * h22 - h12 * h12;
    const ints certain = determinant > MIN_SINE_SQUARED * h11 * h22;
    const floats a = 1.0f + slope.p * slope.p, b = slope.p * slope.q;
    const floats c = 1.0f + slope.q * slope.q;
    const floats by_p = (a * a * h22 - 2.0f * a * b * h12 + b * b * h11) / determinant;
    const floats by_q = (b * b * h22 - 2.0f * b * c * h12 + c * c * h11) / determinant;
    const Slope variance = {certain ? by_p : unknown, certain ? by_q : unknown};
    return variance;
}

// The LEDs whose light is missing.
static ints dim_of(const Pixels *pixels, const Vector n)
{
    const ints nothing = 0;
    ints dim = 0;
    for (int k = 0; k < pixels->K; ++k) {
        const ints bit = 1 << k;
        const floats due = at_least(MIN_EXPECTED_LIGHT,
            shown_by(pixels, dot_of(pixels->vector[k], n)));
        dim |= shown_by(pixels, pixels->light[k]) < 0.5f * due ? bit : nothing;
    }
    return dim;
}

// The sum of squares over the LEDs used; for more than three with a free brightness.
static floats squares_of(
    const Pixels *pixels, const int lit, const Vector normal, const float uneven)
{
    const floats one = 1.0f;
    floats squares = 0.0f, along = 0.0f, whole = 0.0f;
    for (int k = 0; k < pixels->K; ++k)
        if (lit >> k & 1) {
            const floats due = dot_of(pixels->vector[k], normal), away = pixels->light[k] - due;
            const floats weighted = pixels->weight[k] * due;
            squares += pixels->weight[k] * away * away;
            along += weighted * away;
            whole += weighted * due;
        }
    if (popcount(lit) > 3) squares -= brightness_share(whole, one, uneven) * along * along;
    return squares;
}

// The light of the LEDs left out above a shadow's: the second sum of S1.
static floats excess_of(
    const Pixels *pixels, const int lit, const Vector normal, const float one_sided)
{
    const floats none = 0.0f;
    floats excess = 0.0f;
    for (int k = 0; k < pixels->K; ++k)
        if (!(lit >> k & 1)) {
            const floats light = shown_by(pixels, pixels->light[k]), sigma = pixels->sigma[k];
            const floats over = light - shown_by(pixels, dot_of(pixels->vector[k], normal));
            const floats spread = sqrt(sigma * sigma + STRAY_LIGHT * STRAY_LIGHT);
            const floats bright = at_least(0.0f, over / spread + one_sided);
            const floats much = light * (1.0f / MAX_SHADE_LIGHT);
            excess += (pixels->below & (1 << k)) != 0 ? none : bright * bright + much * much;
        }
    return excess;
}

// A lower bound on the cost of an LED left out: its light, whatever the normal is.  An LED below
// the floor is dark and costs nothing here.
static floats light_of_one(const Pixels *pixels, const int k)
{
    const floats none = 0.0f, much = shown_by(pixels, pixels->light[k]) * (1.0f / MAX_SHADE_LIGHT);
    return (pixels->below & (1 << k)) != 0 ? none : much * much;
}

static floats light_of(const Pixels *pixels, const int out)
{
    floats total = 0.0f;
    for (int k = 0; k < pixels->K; ++k)
        if (out >> k & 1) total += light_of_one(pixels, k);
    return total;
}

// The values that follow from the light, its standard deviation, and the pixels' positions.
static void prepare(
    Pixels *here, const Frame *frame, const Rules *rules, const floats x, const floats y,
    const floats z)
{
    const ints nothing = 0;
    ints below = 0;
    here->K = frame->K;
    here->wrap = rules->wrap;
    for (int k = 0; k < frame->K; ++k) {
        const ints bit = 1 << k;
        here->sigma[k] = at_least(1e-5f, here->sigma[k]);
        here->weight[k] = 1.0f / (here->sigma[k] * here->sigma[k]);
        here->vector[k] = light_vector(frame->lights + 3 * k, x, y, z);
        const floats shown = shown_by(here, here->light[k]);
        below |= shown < rules->floor_ * here->sigma[k] ? bit : nothing;
    }
    here->below = rules->dark > 0 ? below : nothing;
    here->forced = rules->wrap == 0.0f ? here->below : nothing;
}

// `count` consecutive pixels.
static void load_run(
    Pixels *here, const Frame *frame, const Rules *rules, const int at, const int count)
{
    const int size = frame->H * frame->W;
    floats x, y;
    places(at, frame->H, frame->W, frame->pixel, &x, &y);
    for (int k = 0; k < frame->K; ++k) {
        FETCH_AHEAD(frame->light + k * size + at, 0);
        FETCH_AHEAD(frame->sigma + k * size + at, 0);
        here->light[k] = load_floats(frame->light + k * size + at, count);
        here->sigma[k] = load_floats(frame->sigma + k * size + at, count);
    }
    prepare(here, frame, rules, x, y, load_floats(frame->height + at, count));
}

// Pixels at any positions.
static void load_list(Pixels *here, const Frame *frame, const Rules *rules, const int *at)
{
    const int size = frame->H * frame->W;
    floats x, y;
    places_of(at, frame->H, frame->W, frame->pixel, &x, &y);
    for (int k = 0; k < frame->K; ++k) {
        here->light[k] = gather_floats(frame->light + k * size, at);
        here->sigma[k] = gather_floats(frame->sigma + k * size, at);
    }
    prepare(here, frame, rules, x, y, gather_floats(frame->height, at));
    here->believed.z = 1.0f;
    if (!rules->pair) {
        here->believed.x = -gather_floats(frame->prior, at);
        here->believed.y = -gather_floats(frame->prior + size, at);
    }
}

// Store to consecutive pixels, or to pixels at any positions.
static void put(
    const floats value, __global float *to, const int first, const int count, const int *at)
{
    if (!at) {
        store_floats(value, to + first, count);
        return;
    }
    float lanes[LANES];
    STORE_LANES(value, lanes);
    for (int l = 0; l < count; ++l)
        if (at[l] >= 0) to[at[l]] = lanes[l];
}

static void put_bytes(
    const ints value, __global uchar *to, const int first, const int count, const int *at)
{
    if (!at) {
        store_bytes(value, to + first, count);
        return;
    }
    int lanes[LANES];
    STORE_LANES(value, lanes);
    for (int l = 0; l < count; ++l)
        if (at[l] >= 0) to[at[l]] = (uchar)lanes[l];
}

static void put_choice(
    const Outputs *outputs, const Frame *frame, const Rules *rules, const Pixels *here,
    const Choice *best, const int first, const int count, const int *at)
{
    const int size = frame->H * frame->W, all = (1 << frame->K) - 1;
    const Vector normal = best->normals.normal;
    const Slope result = slope_of(normal, rules->steepest);
    if (outputs->slope) {
        put(result.p, outputs->slope, first, count, at);
        put(result.q, outputs->slope + size, first, count, at);
    }
    if (outputs->twin) {
        const Slope other = slope_of(best->normals.twin, rules->steepest);
        put(other.p, outputs->twin, first, count, at);
        put(other.q, outputs->twin + size, first, count, at);
    }
    if (outputs->variance) {
        const Slope spread = variance_of(here, best->used, normal, result, rules->uneven);
        put(spread.p, outputs->variance, first, count, at);
        put(spread.q, outputs->variance + size, first, count, at);
    }
    const ints used = best->used & ~here->below;
    if (outputs->used) put_bytes(used, outputs->used, first, count, at);
    if (outputs->shadow) {
        ints dim = 0;
        if (ANY(used != all)) {
            dim = dim_of(here, normal) & ~used;
            dim = best->used == 0 ? here->below : dim;
        }
        put_bytes(dim, outputs->shadow, first, count, at);
    }
    if (outputs->misfit) put(best->misfit, outputs->misfit, first, count, at);
}

// List the pixels that another set may explain better.
static void list_doubtful(
    const Pixels *here, const floats squares, const Rules *rules, const int at, const int count,
    Doubtful *doubtful)
{
    // Leaving an LED out costs at least its price and its light.
    const float price = rules->price, least = fmin(price, rules->dimmed);
    const ints may_be = (here->forced != 0) | !(squares <= least), nothing = 0;
    if (!ANY(may_be)) return;
    ints kind = 0;
    for (int k = 0; k < here->K; ++k) {
        const ints bit = 1 << k;
        kind |= squares > price + light_of_one(here, k) ? bit : nothing;
    }
    const ints may = (here->forced == 0) & (squares < INFINITY), others = 1 << here->K;
    const floats never = INFINITY, cost = may ? squares : never;
    kind |= squares > rules->dimmed ? others : nothing;
    kind = may ? kind : here->forced | others;
    const ints doubt = kind != 0;
    if (!ANY(doubt)) return;
    int kinds[LANES];
    float costs[LANES];
    STORE_LANES(kind, kinds);
    STORE_LANES(cost, costs);
    int number = doubtful->number;
    for (int l = 0; l < count; ++l) {
        doubtful->at[number] = at + l;
        doubtful->kind[number] = kinds[l];
        doubtful->cost[number] = costs[l];
        number += kinds[l] != 0;
    }
    doubtful->number = number;
}

// Assume that every LED reaches `count` pixels, RUN LANES at most.
static ONCE void all_lit(
    const Outputs *outputs, const Frame *frame, const Rules *rules, const int start, const int count,
    Doubtful *doubtful)
{
    const int all = (1 << frame->K) - 1, vectors = (count + LANES - 1) / LANES;
    Pixels here[RUN];
    Equations equations[RUN];
    Judged result[RUN];
    floats squares[RUN];
    for (int r = 0; r < vectors; ++r) {
        const int filled = count == RUN * LANES ? LANES : min(LANES, count - r * LANES);
        load_run(&here[r], frame, rules, start + r * LANES, filled);
    }
    for (int r = 0; r < vectors; ++r) equations[r] = normal_equations(&here[r], all);
    for (int r = 0; r < vectors; ++r)
        result[r] = least_squares(&equations[r], frame->K, rules->uneven);
    for (int r = 0; r < vectors; ++r)
        squares[r] = squares_of(&here[r], all, result[r].judged, rules->uneven);
    for (int r = 0; r < vectors; ++r) {
        const int at = start + r * LANES;
        const int filled = count == RUN * LANES ? LANES : min(LANES, count - r * LANES);
        const Choice lit = {{result[r].normal, result[r].normal}, all, squares[r], squares[r]};
        put_choice(outputs, frame, rules, &here[r], &lit, at, filled, 0);
        list_doubtful(&here[r], squares[r], rules, at, filled, doubtful);
    }
}

// Order the doubtful pixels by kind, so that those processed together try the same sets.
static void sort_by_kind(const Doubtful *doubtful, const int K, int *order)
{
#if LANES == 1
    order[0] = 0;
#else
    int ends[2 << MAX_LEDS];
    const int kinds = 2 << K;
    for (int kind = 0; kind < kinds; ++kind) ends[kind] = 0;
    for (int i = 0; i < doubtful->number; ++i) ++ends[doubtful->kind[i]];
    for (int kind = 1; kind < kinds; ++kind) ends[kind] += ends[kind - 1];
    for (int i = doubtful->number - 1; i >= 0; --i) order[--ends[doubtful->kind[i]]] = i;
#endif
}

// Let all LEDs count at any lower brightness, where no set explains their light at less cost;
// return the pixels for which they do.
static ints allow_dimmed(const Pixels *here, const Rules *rules, Choice *best)
{
    floats darkest = here->light[0], brightest = here->light[0];
    for (int k = 1; k < here->K; ++k) {
        darkest = LESS_OF(darkest, here->light[k]);
        brightest = MORE_OF(brightest, here->light[k]);
    }
    const ints open = (best->cost > rules->dimmed) & (here->below == 0)
        & (darkest > MIN_EVEN_SHARE * brightest);
    if (!ANY(open)) return open;
    const int all = (1 << here->K) - 1;
    const Equations equations = normal_equations(here, all);
    const Vector start = linear(&equations);
    const Equations free = at_any_brightness(&equations, start, ANY_BRIGHTNESS);
    const Vector normal = step_from(&free, start);
    floats missing = 0.0f, cost = rules->dimmed;
    for (int k = 0; k < here->K; ++k) {
        const floats due = dot_of(here->vector[k], normal);
        missing += here->weight[k] * due * (due - here->light[k]);
    }
    // Three LEDs always fit exactly.
    if (here->K > 3) cost += squares_of(here, all, normal, ANY_BRIGHTNESS);
    const ints better = open & (missing > 0.0f) & (cost < best->cost - TIE_COST), labels = all;
    best->cost = better ? cost : best->cost;
    best->misfit = better ? squares_of(here, all, normal, rules->uneven) : best->misfit;
    best->used = better ? labels : best->used;
    best->normals.normal = chosen_of(better, normal, best->normals.normal);
    best->normals.twin = chosen_of(better, normal, best->normals.twin);
    return better;
}

// The set of LEDs that explains some doubtful pixels best, LANES of them at most.
static ONCE void any_set(
    const Outputs *outputs, const Frame *frame, const Rules *rules, const Doubtful *doubtful,
    const int *order, const int count)
{
    const int K = frame->K, all = (1 << K) - 1;
    int at[LANES];
    float costs[LANES];
    for (int l = 0; l < LANES; ++l) {
        at[l] = doubtful->at[order[min(l, count - 1)]];
        costs[l] = doubtful->cost[order[min(l, count - 1)]];
    }
    Pixels here;
    load_list(&here, frame, rules, at);
    const ints most = popcount(here.below) + rules->dark, whole = all, nothing = 0;
    Choice best = {{{0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 1.0f}}, 0, LOAD_LANES(costs), 0.0f};
    best.used = best.cost < INFINITY ? whole : nothing;
    for (int number = 1; number <= K - 2 && ANY(best.cost > rules->price * number); ++number) {
        for (int out = (1 << number) - 1; out <= all; out = next_set(out)) {
            const ints open = (best.cost > rules->price * number + light_of(&here, out))
                & (most >= number) & ((here.forced & ~out) == 0);
            if (!ANY(open)) continue;
            const int lit = all & ~out;
            const ints labels = lit;
            Normals tried;
            Vector judged;
            if (number < K - 2) {
                const Equations equations = normal_equations(&here, lit);
                const Judged result = least_squares(&equations, K - number, rules->uneven);
                judged = result.judged;
                tried.normal = tried.twin = result.normal;
            } else {
                tried = pair_of(&here, lit, rules->pair);
                judged = tried.normal;
            }
            const floats squares = squares_of(&here, lit, judged, rules->uneven);
            const floats excess = excess_of(&here, lit, judged, rules->one_sided);
            const floats cost = squares + rules->price * number + excess;
            const ints better = open & (cost < best.cost - TIE_COST);
            best.cost = better ? cost : best.cost;
            best.misfit = better ? squares : best.misfit;
            best.used = better ? labels : best.used;
            best.normals.normal = chosen_of(better, tried.normal, best.normals.normal);
            best.normals.twin = chosen_of(better, tried.twin, best.normals.twin);
        }
    }
    if (rules->turn > 0.0f) {
        const Equations equations = normal_equations(&here, all);
        const Vector by_all = least_squares(&equations, K, rules->uneven).normal;
        const ints alike = (here.forced == 0)
            & (dot_of(by_all, best.normals.normal) > cos(rules->turn));
        best.used = alike ? whole : best.used;
        best.cost = alike ? LOAD_LANES(costs) : best.cost;
    }
    const ints dimmed = allow_dimmed(&here, rules, &best);
    // If all LEDs explain a pixel best, its result is already written.
    const ints same = (best.used == all) & ~dimmed;
    int stay[LANES];
    STORE_LANES(same, stay);
    int moved = 0;
    for (int l = 0; l < count; ++l) {
        moved |= !stay[l];
        if (stay[l]) at[l] = -1;
    }
    if (moved) put_choice(outputs, frame, rules, &here, &best, 0, count, at);
}

// The set of LEDs that explains a pixel best, and its slope; see nodes/shadow/label_lights.py. Most
// pixels are lit by all LEDs, and the others are processed together.
LANED __kernel void label_lights(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict lights,
    __global const float *restrict height,
    __global const float *restrict prior,
    const float pixel,
    const float uneven,
    const float wrap,
    const float turn,
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
    const float steepest,
    const float dimmed)
{
    // One work-item does its own part and that of the following ones.
    const int item = get_global_id(0), end = min(LANES * (item + SHARE), H * W);
    if (item % SHARE) return;
    const Frame frame = {light, sigma, lights, height, prior, pixel, K, H, W};
    const Outputs outputs = {slope, twin, variance, misfit, used, shadow};
    const Rules rules = {pair, dark, floor_, price, one_sided, steepest, dimmed, uneven, wrap, turn};
    Doubtful doubtful;
    doubtful.number = 0;
    for (int at = LANES * item; at < end; at += RUN * LANES)
        // The compiler can tell that a run is complete where it is.
        if (end - at >= RUN * LANES)
            all_lit(&outputs, &frame, &rules, at, RUN * LANES, &doubtful);
        else
            all_lit(&outputs, &frame, &rules, at, end - at, &doubtful);
    if (doubtful.number == 0) return;
    int order[SHARE * LANES];
    sort_by_kind(&doubtful, K, order);
    for (int i = 0; i < doubtful.number; i += LANES)
        any_set(&outputs, &frame, &rules, &doubtful, order + i, min(LANES, doubtful.number - i));
}
