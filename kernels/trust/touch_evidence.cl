#include "common.clh"
#include "border.clh"
#include "near_light.clh"
#include "group.clh"
#include "drift.clh"
#include "ring.clh"

#define MIN_CELLS 20
#define MIN_LEDS 3
#define FULL_MISFIT_SLOPE 0.1f
#define MAX_SQUARED_BEND 0.16f

#define CURL_BANDS 9
#define NOT_TESTED (-1.0f)
#define DRIFT_TERMS 6
#define CALM_DEPARTURE 0.03f
#define DARK_LIGHT 0.05f

// The rows of `values`, of h x w cells each; UNTOLD where a cell gives no evidence.
#define AT_REST 0
#define TOUCHED 1
#define IN_SHADOW 2
#define BRIGHTER 3
#define UNTOLD (-INFINITY)

// Where the figures of the film and of the light begin, after those of the curl.
#define OF_FILM 1
#define OF_LIGHT 6

// Cells of h x w, every step-th of every step-th row of H x W.
#define EACH_CELL(y, x, count)                                                                   \
    const int across = (w + LANES - 1) / LANES;                                                  \
    for (int j = PLACE_IN_GROUP, y = j / across, x = LANES * (j - y * across),                    \
             count = min(LANES, w - x);                                                          \
         j < h * across;                                                                         \
         j += GROUP, y = j / across, x = LANES * (j - y * across), count = min(LANES, w - x))

// The cells of a plane from x on, shifted by `beside` elements of the plane; the border repeats.
static floats load_thin(
    __global const float *row, const int x, const int beside, const int count, const int W,
    const int step)
{
    if (step == 1) return load_within_border(row, x + beside, count, W, REPLICATE);
    float result[LANES];
    for (int l = 0; l < LANES; ++l) result[l] = row[clamp((x + l) * step + beside, 0, W - 1)];
    return LOAD_LANES(result);
}

static ints load_bytes_thin(
    __global const uchar *row, const int x, const int count, const int W, const int step)
{
    if (step == 1) return load_bytes(row + x, count);
    uchar result[LANES];
    for (int l = 0; l < LANES; ++l) result[l] = row[min((x + l) * step, W - 1)];
    return TO_INTS(LOAD_LANES(result));
}

// The squared difference of the slopes from those two elements away, in a row and a column.
static floats squared_bend(
    __global const float *slope, const int y, const int x, const int count, const int H,
    const int W, const int step)
{
    floats across = 0.0f, down = 0.0f;
    for (int c = 0; c < 2; ++c) {
        __global const float *row = slope + (c * H + y) * W;
        const floats twice = 2.0f * load_thin(row, x, 0, count, W, step);
        const floats apart =
            load_thin(row, x, 2, count, W, step) + load_thin(row, x, -2, count, W, step) - twice;
        across += apart * apart;
        if (y < 2 || y >= H - 2) continue;
        const floats from = load_thin(row + 2 * W, x, 0, count, W, step)
            + load_thin(row - 2 * W, x, 0, count, W, step) - twice;
        down += from * from;
    }
    const floats column = ((float)x + LANE_NUMBERS) * (float)step, none = 0.0f;
    const floats first = 2.0f, last = (float)(W - 2);
    const ints within = (column >= first) & (column < last);
    return (within ? across : none) + down;
}

static ints is_steep(
    __global const float *slope, const int y, const int x, const int count, const int H,
    const int W, const int step)
{
    const floats p = load_thin(slope + y * W, x, 0, count, W, step);
    const floats q = load_thin(slope + (H + y) * W, x, 0, count, W, step);
    return p * p + q * q > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE;
}

// The evidence of each cell on the light, and the numbers of cells that give it.
static ONCE void look_at_light(
    __global const float *departure,
    __global const float *brighter,
    __global const float *slope,
    __global const uchar *used,
    __global const float *matt,
    __global const uchar *shadow,
    __global float *values,
    __global float *out,
    const int K, const int H, const int W,
    const int h, const int w, const int step,
    const float max_dimming, SHARED float *parts)
{
    const floats one = 1.0f, none = 0.0f, untold = UNTOLD;
    const ints all_leds = (1 << K) - 1, no_leds = 0;
    floats steep = none, bent = none, dirty = none;
    EACH_CELL(y, x, count)
    {
        const int from = y * step, at = y * w + x;
        const ints here = filled(count), is = is_steep(slope, from, x, count, H, W, step) & here;
        const floats bend = ANY(is) ? squared_bend(slope, from, x, count, H, W, step) : none;
        const floats chi = load_thin(departure + from * W, x, 0, count, W, step);
        const ints tests = chi >= 0.0f;
        const ints bits = used ? load_bytes_thin(used + from * W, x, count, W, step) : all_leds;
        const ints dark = shadow ? load_bytes_thin(shadow + from * W, x, count, W, step) : no_leds;
        floats light = none, leds = none;
        for (int k = 0; k < K && matt; ++k) {
            const floats touched_light = load_thin(matt + (k * H + from) * W, x, 0, count, W, step);
            light += ((dark >> k) & 1) != 0 ? touched_light : none;
            leds += ((dark >> k) & 1) != 0 ? one : none;
        }
        floats excess = untold;
        if (brighter) {
            excess = load_thin(brighter + from * W, x, 0, count, W, step);
            const ints certain = has_bits(bits, MIN_LEDS) & here;
            const ints lacks = certain & (excess < -max_dimming);
            const ints touched = certain & (is | (fabs(excess) > FULL_MISFIT_SLOPE));
            dirty += lacks ? one : none;
            excess = touched ? excess : untold;
        }
        steep += is ? one : none;
        const ints rests = tests & ~is, shows = tests & is;
        const ints bends = is & (bend > MAX_SQUARED_BEND);
        bent += bends ? one : none;
        store_floats(rests ? chi : untold, values + AT_REST * h * w + at, count);
        store_floats(shows ? chi : untold, values + TOUCHED * h * w + at, count);
        const floats dim = ANY(leds > 0.0f) ? (leds > 0.0f ? light / leds : untold) : untold;
        store_floats(dim, values + IN_SHADOW * h * w + at, count);
        store_floats(excess, values + BRIGHTER * h * w + at, count);
    }
    const float cells = group_sum(steep, parts), edges = group_sum(bent, parts);
    const float dirt = group_sum(dirty, parts);
    // Where most of the touch may contain edges its light is not compared.
    if (4.0f * edges > 3.0f * cells) {
        EACH_CELL(y, x, count)
        {
            store_floats(untold, values + TOUCHED * h * w + y * w + x, count);
            store_floats(untold, values + BRIGHTER * h * w + y * w + x, count);
        }
    }
    if (PLACE_IN_GROUP == 0) *out = dirt;
}

// The film at rest under K LEDs, on h x w cells, and the range of N heights.
static ONCE void look_at_rest(
    __global const float *light,
    __global const float *height,
    __global const float *drift,
    __global float *ring,
    __global float *gains,
    __global float *level,
    __global float *film,
    const int K, const int h, const int w, const int N,
    SHARED float *parts)
{
    const int me = PLACE_IN_GROUP, size = h * w;
    int result = 0;
    for (int k = 0; k < K && drift; ++k) result |= drift[DRIFT_TERMS * k] != 1.0f;
    float shape = 0.0f;
    if (result) {
        for (int k = 0; k < K; ++k)
            for (int j = 1; j < DRIFT_TERMS; ++j)
                shape = fmax(shape, fabs(drift[DRIFT_TERMS * k + j]));
        for (int k = me; k < K; k += GROUP) level[k] = drift[DRIFT_TERMS * k];
    } else {
        const int around = ring_size(h, w, 1);
        for (int k = 0; k < K; ++k) {
            for (int j = me; j < around; j += GROUP) ring[j] = light[k * size + on_ring(j, h, w, 1)];
            WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
            const float middle = group_median(ring, around, parts);
            if (me == 0) level[k] = middle;
            for (int j = me; j < DRIFT_TERMS; j += GROUP)
                gains[DRIFT_TERMS * k + j] = j == 0 ? fmax(middle, DARK_LIGHT) : 0.0f;
            WAIT_FOR_GROUP(CLK_GLOBAL_MEM_FENCE);
        }
        drift = gains;
    }
    const floats one = 1.0f, none = 0.0f;
    floats calm = none, dark = none, lowest = INFINITY, highest = -INFINITY;
    EACH_OF_GROUP(i, count, size)
    {
        floats u, v;
        places(i, h, w, 2.0f / (float)w, &u, &v);
        ints rests = filled(count), unlit = rests;
        for (int k = 0; k < K; ++k) {
            const floats here = load_floats(light + k * size + i, count);
            const floats even = here / drift_gain(drift, k, u, v);
            rests &= fabs(even - 1.0f) < CALM_DEPARTURE;
            unlit &= even < DARK_LIGHT;
        }
        calm += rests ? one : none;
        dark += unlit ? one : none;
    }
    EACH_OF_GROUP(i, count, N)
    {
        const floats z = load_floats(height + i, count);
        lowest = LESS_OF(lowest, z);
        highest = MORE_OF(highest, z);
    }
    const float rest = group_sum(calm, parts), black = group_sum(dark, parts);
    const float top = group_highest(highest_lane(highest), parts);
    const float bottom = -group_highest(-lowest_lane(lowest), parts);
    if (me != 0) return;
    film[0] = shape;
    film[1] = rest / (float)size;
    film[2] = black / (float)size;
    film[3] = bottom;
    film[4] = top;
}

// By one group each: the evidence of a touch's light, and the film at rest.
LANED __kernel ONE_GROUP void look(
    __global const float *restrict departure,
    __global const float *restrict brighter,
    __global const float *restrict slope,
    __global const uchar *restrict used,
    __global const float *restrict matt,
    __global const uchar *restrict shadow,
    __global const float *restrict light,
    __global const float *restrict height,
    __global const float *restrict drift,
    __global float *restrict values,
    __global float *restrict ring,
    __global float *restrict gains,
    __global float *restrict level,
    __global float *restrict figures,
    const int K, const int H, const int W,
    const int h, const int w, const int step,
    const int rows, const int columns,
    const float max_dimming)
{
    SHARED float parts[GROUP];
    __global float *dirty = figures + OF_LIGHT + 4, *film = figures + OF_FILM;
    if (get_group_id(0) == 1)
        look_at_rest(light, height, drift, ring, gains, level, film, K, rows, columns, H * W, parts);
    else if (departure && slope)
        look_at_light(departure, brighter, slope, used, matt, shadow, values, dirty, K, H, W,
            h, w, step, max_dimming, parts);
    else if (PLACE_IN_GROUP == 0)
        *dirty = -1.0f;
}

// The greatest mean of the curl in a band of rows.
static ONCE float worst_band(__global const float *curl, const int h, const int w, SHARED float *parts)
{
    float worst = 0.0f;
    for (int b = 0; b < CURL_BANDS; ++b) {
        const int from = b * h / CURL_BANDS * w, size = (b + 1) * h / CURL_BANDS * w - from;
        const floats none = 0.0f, one = 1.0f;
        floats tested = none, curls = none;
        EACH_OF_GROUP(i, count, size)
        {
            const floats here = load_floats(curl + from + i, count);
            const ints tests = filled(count) & (here >= 0.0f);
            tested += tests ? one : none;
            curls += tests ? sqrt(here) : none;
        }
        const float sum = group_sum(curls, parts), cells = group_sum(tested, parts);
        worst = fmax(worst, sum / (cells + (float)MIN_CELLS));
    }
    return worst;
}

// By a group each: a median or a quartile of the light's N values, and the worst band of the curl.
LANED __kernel ONE_GROUP void weigh(
    __global const float *restrict values,
    __global const float *restrict curl,
    __global float *restrict figures,
    const int N, const int h, const int w)
{
    SHARED float parts[GROUP];
    __global float *light_figures = figures + OF_LIGHT;
    const int quarters[4] = {2, 3, 1, 2};
    const int which = get_group_id(0), of_light = which < 4;
    float result = 0.0f;
    if (!of_light) {
        result = worst_band(curl, h, w, parts);
    } else if (light_figures[4] >= 0.0f) {
        result = group_quarter(values + which * N, UNTOLD, N, quarters[which], MIN_CELLS, parts);
        if (which == AT_REST || which == TOUCHED) result = sqrt(result);
    }
    if (PLACE_IN_GROUP == 0) *(of_light ? light_figures + which : figures) = result;
}

// Every step-th cell of every step-th row of K planes.
__kernel void thin(
    __global const float *restrict cells, __global float *restrict out,
    const int K, const int h, const int w, const int H, const int W, const int step)
{
    GRID_3(k, y, x, K, h, w)
    out[(k * h + y) * w + x] = cells[(k * H + y * step) * W + x * step];
}
