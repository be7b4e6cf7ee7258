// Equations H2 and H3 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "group.clh"
#include "border.clh"
#include "bend.clh"
#include "springs.clh"
#include "spring_cells.clh"
#include "height_system.clh"
#include "film.clh"

#define MAX_SLOPE 3.0f
#define MIN_DETERMINANT_SHARE 1e-4f
#define RESOLVED_BEND 0.5f
#define FULL_MISFIT_SLOPE 0.1f
#define LEVEL_MISFIT_SHARE 0.3f
#define MIN_SHARPNESS 0.5f
#define UNSHARP_SHARE 0.57735027f
#define MAX_CORRECTION 0.05f
#define FOLD_VARIANCES 10.006145f
#define ERROR_COUNT 8
#define MIRRORED 2
// The number of LEDs: if the compiler knows it, loops over them are unrolled.
#ifdef LEDS
#define EACH_LED(k) _Pragma("unroll") for (int k = 0; k < LEDS; ++k)
#define LED_SLOTS LEDS
#else
#define EACH_LED(k) for (int k = 0; k < K; ++k)
#define LED_SLOTS 8
#endif

// The hash of nodes/error/_random_errors.py of one number, or of several in lanes.
#define SCATTER(x) \
    x ^= x >> 16;  \
    x *= 0x7feb352dU; \
    x ^= x >> 15;  \
    x *= 0x846ca68bU; \
    x ^= x >> 16;

// +1 or -1, by the hash of a number and of the draw's key.
static float drawn(const uint number, const uint key)
{
    uint x = number ^ key;
    SCATTER(x)
    return x >> 31 ? 1.0f : -1.0f;
}

// The same for consecutive numbers.
#if LANES == 1
#define uints uint
#define LANE_COUNTS 0u
#else
#define uints uint16
#define LANE_COUNTS ((uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#endif
static floats drawn_from(const uint number, const uint key)
{
    const floats up = 1.0f, down = -1.0f;
    uints x = (number + LANE_COUNTS) ^ key;
    SCATTER(x)
    return AS_INTS(x) < 0 ? up : down;
}

// The derivatives of p and q with respect to each LED's light.
typedef struct {
    floats by_p[LED_SLOTS], by_q[LED_SLOTS];
} Response;

// Nothing on the film at rest.
static Response respond(
    const floats p, const floats q, const floats nz, const floats x, const floats y, const floats z,
    const ints free_, const ints used, const floats *noise, __global const float *lights,
    const int K, const float uneven)
{
    const floats none = 0.0f, tiny = 1e-10f, one = 1.0f;
    const ints one_more = 1, nothing = 0;
    floats response_a[LED_SLOTS], response_b[LED_SLOTS], shown[LED_SLOTS], weight[LED_SLOTS];
    floats by_shown_a = 0.0f, by_shown_b = 0.0f, whole = 0.0f;
    ints leds = 0;
    EACH_LED(k) {
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats square = noise[k] * noise[k], sure = 1.0f / MORE_OF(square, tiny);
        const ints lit = (used & (1 << k)) != 0;
        response_a[k] = (v.x + v.z * p) * nz;
        response_b[k] = (v.y + v.z * q) * nz;
        shown[k] = (v.z - v.x * p - v.y * q) * nz;
        weight[k] = lit ? sure : none;
        by_shown_a += weight[k] * shown[k] * response_a[k];
        by_shown_b += weight[k] * shown[k] * response_b[k];
        whole += weight[k] * shown[k] * shown[k];
        leds += lit ? one_more : nothing;
    }
    // For three LEDs or more, minus the part that the film's brightness explains.
    const floats share = leds > 2 ? brightness_share(whole, one, uneven) : none;
    floats aa = 0.0f, ab = 0.0f, bb = 0.0f;
    EACH_LED(k) {
        const floats a = response_a[k], b = response_b[k];
        response_a[k] = weight[k] * (a - share * by_shown_a * shown[k]);
        response_b[k] = weight[k] * (b - share * by_shown_b * shown[k]);
        aa += response_a[k] * a;
        ab += response_a[k] * b;
        bb += response_b[k] * b;
    }
    const floats determinant = aa * bb - ab * ab;
    const ints certain = (determinant > MIN_DETERMINANT_SHARE * aa * bb) & free_;
    const floats divisor = certain ? determinant : one;
    const floats inverse = certain ? 1.0f / divisor : none;
    Response result;
    EACH_LED(k) {
        const floats by_a = (bb * response_a[k] - ab * response_b[k]) * inverse;
        const floats by_b = (aa * response_b[k] - ab * response_a[k]) * inverse;
        result.by_p[k] = -((1.0f + p * p) * by_a + p * q * by_b);
        result.by_q[k] = -(p * q * by_a + (1.0f + q * q) * by_b);
    }
    return result;
}

// How much faster a coated film's light changes with its normal than a matt film's, over the LEDs
// that count; `coat_sharpness` of nodes/optics/film.py. Also gives the light, relative to that of
// the film at rest.
static floats sharpness(
    const Film *film, const floats p, const floats q, const floats u, const floats v,
    const floats apparent, const ints used, const floats *noise, floats *light)
{
    const floats none = 0.0f, tiny = 1e-10f, one = 1.0f;
    const floats z = apparent / (1.0f + film->camera * apparent), nearer = 1.0f - film->camera * z;
    const Places here = {u * nearer, v * nearer, z, u, v};
    const Vector eye = to_pupil(film, here.x, here.y, z), n = unit(-p, -q, one);
    const Vector way_s = {n.z, none, -n.x}, way_t = {none, n.z, -n.y};
    const Facing as_is = facing_of(film, n, eye);
    floats coated = 0.0f, matt = 0.0f;
    const int K = film->K;
    EACH_LED(k) {
        AtPlace there;
        const floats rest = 1.0f / light_at_rest(film, k, u, v);
        set_place(&there, film, k, eye, &here, one, emitted(film, k, &here), rest, 0);
        const Turning by = turning_of(film, &there, &as_is);
        const Vector way = matt_way(film->lights + 3 * k, &here);
        const floats by_s = dot_of(way, way_s), by_t = dot_of(way, way_t);
        const floats square = noise[k] * noise[k], sure = 1.0f / MORE_OF(square, tiny);
        const floats weight = (used & (1 << k)) != 0 ? sure : none;
        const float direct = 1.0f - film->diffuse[k];
        light[k] = by.light / direct;
        coated += 1.0f / (direct * direct) * weight * (by.by_s * by.by_s + by.by_t * by.by_t);
        matt += weight * (by_s * by_s + by_t * by_t);
    }
    const floats least = MIN_SHARPNESS, sharper = sqrt(coated / (matt > none ? matt : one));
    return matt > none ? MORE_OF(sharper, least) : one;
}

// The cosine of an angle in turns, by Taylor's series of the sine up to a quarter: within 4e-6.
static floats cosine_of(const floats turns)
{
    // To the nearest integer; some compilers expand the built-in lane by lane.
    const floats whole = (turns + 12582912.0f) - 12582912.0f, over = turns - whole;
    const floats x = 6.2831853f * (0.25f - MORE_OF(over, -over)), square = x * x;
    const floats inner = fma(square, 2.7557319e-6f, -1.9841270e-4f);
    return x * fma(square, fma(square, fma(square, inner, 8.3333333e-3f), -0.16666667f), 1.0f);
}

// The parameters of each error: its signs for the wrong share of bounced light, for light that has
// not converged, for the lean of all normals and for a pixel's mean slope; its wave's direction,
// phase in turns, and length.
typedef struct {
    float sign, settling, leaning, averaged, across, down, phase, wavelength;
} Kind;

// The light of each LED for the slopes found, relative to that of the film at rest, and the ratio
// of the slope's errors to those that a matt film's light would give.
LANED __kernel void shine(
    __global const float *restrict sigma, __global const float *restrict height,
    __global const float *restrict slope, __global const uchar *restrict used,
    __global const float *restrict lights, __global const float *let_in_curve, const float base,
    const float roughness, const float camera, const float refraction,
    __global const float *restrict diffuse, __global float *restrict light,
    __global float *restrict blunt, const int K, const int frame_height, const int frame_width,
    const int top, const int left, const int H, const int W, const float pixel)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int frame_size = frame_height * frame_width;
    const int i = row * W + column, from = (top + row) * frame_width + left + column;
    const floats x =
        ((float)(left + column) + LANE_NUMBERS - 0.5f * (float)(frame_width - 1)) * pixel;
    const floats y = ((float)(top + row) - 0.5f * (float)(frame_height - 1)) * pixel;
    const floats z = load_floats(height + from, count), none = 0.0f;
    const floats p = load_floats(slope + from, count);
    const floats q = load_floats(slope + frame_size + from, count);
    floats shown[LED_SLOTS], sharper = 1.0f;
    if (refraction != 1.0f) {
        const Film film = {
            lights, diffuse, 0, let_in_curve, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f, base, roughness,
            refraction, camera, 0.0f, 0.0f, K, 0};
        floats noise[LED_SLOTS];
        EACH_LED(k) noise[k] = load_floats(sigma + k * frame_size + from, count);
        const ints lit = load_bytes(used + from, count);
        sharper = sharpness(&film, p, q, x, y, z, lit, noise, shown);
    } else {
        const floats nz = 1.0f / sqrt(1.0f + p * p + q * q);
        EACH_LED(k) {
            const Vector v = light_vector(lights + 3 * k, x, y, z);
            const floats faced = (v.z - v.x * p - v.y * q) * nz;
            shown[k] = MORE_OF(faced, none);
        }
    }
    EACH_LED(k) store_floats(shown[k], light + k * H * W + i, count);
    store_floats(1.0f / sharper, blunt + i, count);
}

// From what lies before a pixel, by the two pixels there, up to the pixel and to what lies after it.
typedef struct { floats up, across; } Sides;

static Sides sides_at(
    __global const float *plane, const int y, const int x, const int count, const int H,
    const int W, const int stride, const int down)
{
    floats at[5];
    for (int n = -2; n <= 2; ++n) {
        __global const float *row = plane + clamp(y + n * down, 0, H - 1) * stride;
        at[n + 2] = load_within_border(row, x + n * (1 - down), count, W, REPLICATE);
    }
    const floats before = 2.0f * at[1] - at[0], after = 2.0f * at[3] - at[4];
    const Sides sides = {at[2] - before, after - before};
    return sides;
}

// The errors of the slopes inside the window, all in one launch because they read the same data:
// the lights' noise; errors that all pixels of an LED share, of the LEDs' positions and light and
// of the bounced light; errors of a pixel's mean slope and of the blur; and normals that lean in
// waves because the film's model is wrong.
LANED __kernel void err_slopes(
    __global const float *restrict sigma,
    __global const float *restrict height, __global const float *restrict slope,
    __global const uchar *restrict state, __global const uchar *restrict used,
    __global const float *restrict lights, __global const float *restrict others,
    __global const float *restrict light, __global const float *restrict blunt,
    __global float *restrict out, const int K, const int frame_height, const int frame_width,
    const int top, const int left, const int H, const int W, const float pixel,
    const float shared, const float uneven, const float half_spread, const int with_folds,
    __global const float *restrict kinds,
    __global const uint *restrict keys, __global const float *misfit,
    __global const float *apparent,
    __global const float *bounced, __global const float *own_bounce, __global const float *tilt,
    __global const float *restrict diffuse, const float refraction)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    __global const Kind *kind = (__global const Kind *)kinds;
    const int frame_size = frame_height * frame_width;
    const int i = row * W + column, from = (top + row) * frame_width + left + column;
    const float middle = 0.5f * (float)(frame_width - 1);
    const floats x = ((float)(left + column) + LANE_NUMBERS - middle) * pixel;
    const floats y = ((float)(top + row) - 0.5f * (float)(frame_height - 1)) * pixel;
    const floats z = load_floats(height + from, count), none = 0.0f;
    const floats a = load_floats(slope + from, count);
    const floats b = load_floats(slope + frame_size + from, count);
    const floats nz = 1.0f / sqrt(1.0f + a * a + b * b);
    const float wrong = misfit[3], departs = misfit[2];
    const floats whole = 1.0f;
    floats noise[LED_SLOTS];
    EACH_LED(k) noise[k] = load_floats(sigma + k * frame_size + from, count);
    const ints free_ = load_bytes(state + i, count) == 0;
    const Response response = respond(
        a, b, nz, x, y, z, free_, load_bytes(used + from, count), noise, lights, K, uneven);
    const floats less = load_floats(blunt + i, count);
    float sharpened = refraction == 1.0f ? MAX_CORRECTION : 0.0f;
    EACH_LED(k) sharpened = diffuse[k] != 0.0f ? 0.0f : sharpened;
    floats flatter_p = 0.0f, flatter_q = 0.0f;
    floats p[ERROR_COUNT], q[ERROR_COUNT], pp = 0.0f, pq = 0.0f, qq = 0.0f;
    for (int n = 0; n < ERROR_COUNT; ++n) p[n] = q[n] = 0.0f;
    EACH_LED(k) {
        const int at = k * frame_size + from;
        const floats noisy = shared * noise[k];
        const floats to_p = response.by_p[k], to_q = response.by_q[k];
        const floats apparent_p = to_p * less, apparent_q = to_q * less;
        const floats noise_p = apparent_p * noisy, noise_q = apparent_q * noisy;
        pp += noise_p * noise_p;
        pq += noise_p * noise_q;
        qq += noise_q * noise_q;
        if (half_spread > 0.0f) {
            const Bend bend = bend_at(light + k * H * W, row, column, count, H, W);
            const floats gathered = half_spread * (bend.across + bend.along);
            flatter_p -= apparent_p * gathered;
            flatter_q -= apparent_q * gathered;
        }
        __global const float *led = lights + 3 * k;
        const Vector by = light_by_place(led, x, y, z, a, b, nz);
        for (int n = 0; n < ERROR_COUNT; ++n) {
            __global const float *other = others + 3 * (n * K + k);
            // A row of Hadamard's matrix for each LED (LED_SIGNS).
            const float led_sign = popcount(n & k) & 1 ? -1.0f : 1.0f;
            const floats change = led_sign * departs +
                (other[0] - led[0]) * by.x + (other[1] - led[1]) * by.y + (other[2] - led[2]) * by.z;
            p[n] += to_p * change;
            q[n] += to_q * change;
        }
        if (bounced) {
            const floats thrown = load_floats(bounced + at, count);
            const floats unsettled =
                own_bounce ? thrown - load_floats(own_bounce + at, count) : none;
            for (int n = 0; n < ERROR_COUNT; ++n) {
                const floats change =
                    kind[n].sign * wrong * thrown + kind[n].settling * unsettled;
                p[n] += apparent_p * change;
                q[n] += apparent_q * change;
            }
        }
    }
    // What folds under a coat hide of the mean slope (`folds` of nodes/error/_slope_errors.py).
    const floats tiny = 1e-10f;
    floats turn = FOLD_VARIANCES * (pp + qq), hidden_p = 0.0f, hidden_q = 0.0f;
    for (int down = 0; with_folds && down < 2; ++down) {
        __global const float *first = slope + top * frame_width + left;
        const Sides of_p = sides_at(first, row, column, count, H, W, frame_width, down);
        first += frame_size;
        const Sides of_q = sides_at(first, row, column, count, H, W, frame_width, down);
        const floats product =
            of_p.up * (of_p.across - of_p.up) + of_q.up * (of_q.across - of_q.up);
        const ints folded = product > turn;
        floats along = 0.0f, square = tiny;
        EACH_LED(k) {
            const Sides lit = sides_at(light + k * H * W, row, column, count, H, W, W, down);
            along += lit.up * lit.across;
            square += lit.across * lit.across;
        }
        const floats part = clipped(along / square - 0.5f, 0.5f) + 0.5f;
        turn = folded ? product : turn;
        hidden_p = folded ? part * of_p.across - of_p.up : hidden_p;
        hidden_q = folded ? part * of_q.across - of_q.up : hidden_q;
    }
    const floats limit = sharpened * (1.0f + a * a + b * b);
    const floats blurred_p = flatter_p - (1.0f - UNSHARP_SHARE) * clipped(flatter_p, limit);
    const floats blurred_q = flatter_q - (1.0f - UNSHARP_SHARE) * clipped(flatter_q, limit);
    const floats mean_p = a - load_floats(apparent + from, count) + blurred_p + hidden_p;
    const floats mean_q = b - load_floats(apparent + frame_size + from, count) + blurred_q + hidden_q;
    // A square root of the covariance of p and q.
    const floats alone = sqrt(pp), along = pq / MORE_OF(alone, tiny);
    const floats rest_ = qq - along * along, across = sqrt(MORE_OF(rest_, none));
    for (int n = 0; n < ERROR_COUNT; ++n) {
        const floats first = drawn_from(i, keys[n]);
        const floats second = drawn_from(H * W + i, keys[n]);
        p[n] += alone * first;
        q[n] += along * first + across * second;
    }
    const floats level = LEVEL_MISFIT_SHARE, full = FULL_MISFIT_SLOPE;
    // The slope minus that of the film at rest, where the flat frame cancels the model's errors.
    const floats sunk_p = tilt ? a - load_floats(tilt + from, count) : a;
    const floats sunk_q = tilt ? b - load_floats(tilt + frame_size + from, count) : b;
    const floats square = sunk_p * sunk_p + sunk_q * sunk_q, slant = sqrt(square);
    const floats share = slant / FULL_MISFIT_SLOPE, above = MORE_OF(share, level);
    const floats tilted = LESS_OF(above, whole), leans = MORE_OF(slant, full);
    for (int n = 0; n < ERROR_COUNT; ++n) {
        p[n] = clipped(p[n] + kind[n].averaged * mean_p, MAX_SLOPE);
        q[n] = clipped(q[n] + kind[n].averaged * mean_q, MAX_SLOPE);
        const float right = kind[n].across, down = kind[n].down;
        const float per_mm = 1.0f / (kind[n].wavelength * fmax(misfit[1], pixel));
        const floats turns = per_mm * (right * x + down * y) + kind[n].phase;
        const floats lean = 1.4142136f * misfit[0] * tilted * cosine_of(turns);
        const floats steeper = kind[n].leaning * (misfit[4] / leans);
        const floats uphill = lean * (right * sunk_p + down * sunk_q) + steeper * (1.0f + square);
        p[n] = clipped(p[n] + lean * right + uphill * sunk_p, MAX_SLOPE);
        q[n] = clipped(q[n] + lean * down + uphill * sunk_q, MAX_SLOPE);
        store_floats(p[n], out + 2 * n * H * W + i, count);
        store_floats(q[n], out + (2 * n + 1) * H * W + i, count);
    }
}

LANED __kernel void err_steps(
    __global const float *restrict slopes, __global float *restrict right,
    __global float *restrict down, const int H, const int W, const int number, const int to,
    const float pixel)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int i = y * W + x, out = to * H * W + i;
    __global const float *p = slopes + 2 * number * H * W, *q = p + H * W;
    const floats none = 0.0f, column = (float)x + LANE_NUMBERS;
    const floats beside = load_within_border(p + y * W, x + 1, count, W, REPLICATE);
    const floats east = (beside + load_floats(p + i, count)) * (0.5f * pixel);
    const floats below = load_floats(q + min(y + 1, H - 1) * W + x, count);
    const floats south = (below + load_floats(q + i, count)) * (0.5f * pixel);
    store_floats(column < (float)(W - 1) ? east : none, right + out, count);
    store_floats(y + 1 < H ? south : none, down + out, count);
}

__kernel void err_rises(
    __global float *restrict rise, __global const float *restrict want_rise,
    __global const float *restrict z, __global const int *restrict tie_ends,
    __global const float *restrict diffuse, const int K, const int ties, const int to,
    const float error, const float sign_, const int first, const uint key)
{
    GRID_1(t, ties)
    float residual = z[tie_ends[2 * t]] - z[tie_ends[2 * t + 1]] - want_rise[t];
    for (int k = 0; k < K; ++k)
        if (diffuse[k] > 0.0f) residual = 0.0f; // Their shadows end softly: the rises err.
    rise[to * ties + t] = sign_ * residual + error * drawn(first + t, key);
}

// The mean over errors of the squared changes.
LANED __kernel void mean_square(
    __global const float *restrict moved, __global float *restrict mean, const int size,
    const int loads)
{
    GRID_LANES(i, count, size)
    floats sum = 0.0f;
    for (int load_ = 0; load_ < loads; ++load_) {
        const floats each = load_floats(moved + load_ * size + i, count);
        sum += each * each;
    }
    store_floats(sum / (float)loads, mean + i, count);
}

// The pixels that count and are not at rest, and the logarithm of their variance.
__kernel void free_logarithm(
    __global const uchar *restrict state, __global float *restrict variance,
    __global float *restrict freed, const int H, const int W, const float least)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    freed[i] = state[i] ? 0.0f : 1.0f;
    variance[i] = state[i] ? 0.0f : log(fmax(variance[i], least));
}

// Weighted mean along one axis (1: x); beyond the ends, pixels are mirrored about the last one.
LANED __kernel void blur(
    __global const float *restrict plane, __global const float *restrict weights,
    __global float *restrict out, const int H, const int W, const int radius, const int axis)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    floats total = 0.0f;
    for (int n = -radius; n <= radius; ++n) {
        const int row = within_border(y + n, H, MIRRORED);
        total += weights[n + radius] * (axis
            ? load_within_border(plane + y * W, x + n, count, W, MIRRORED)
            : load_floats(plane + row * W + x, count));
    }
    store_floats(total, out + y * W + x, count);
}

// The root of the geometric mean of the variance; zero where nothing is free. Within a pixel an
// edge may lie anywhere.
LANED __kernel void deviation(
    __global const float *restrict logarithm, __global const float *restrict weight,
    __global const float *restrict freed, __global const float *restrict height,
    __global float *restrict out, const int frame_height, const int frame_width, const int top,
    const int left, const int H, const int W, const float pixel, const float place_px,
    const float log_bias)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int i = y * W + x;
    const floats none = 0.0f, least = 1e-3f, total = load_floats(weight + i, count);
    const floats bend = largest_bend(height, top + y, left + x, count, frame_height, frame_width);
    const floats beyond = bend - RESOLVED_BEND * pixel, edge = place_px * MORE_OF(beyond, none);
    const floats mean = exp(load_floats(logarithm + i, count) / MORE_OF(total, least) + log_bias);
    const floats result = sqrt(mean + edge * edge);
    const ints free = load_floats(freed + i, count) > 0.0f;
    store_floats(free ? result : none, out + (top + y) * frame_width + left + x, count);
}
