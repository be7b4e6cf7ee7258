#include "common.clh"
#include "lanes.clh"
#include "pixels.clh"
#include "lens.clh"
#include "bicubic.clh"
#include "between_cells.clh"

#define MAX_LEDS 8
#define GRAIN_CELL_PX 4
#define FRACTION_BITS 23
#define PHILOX_ROUNDS 10

#if LANES == 1
typedef ulong ulongs;
#define TO_ULONGS convert_ulong
#else
typedef ulong16 ulongs;
#define TO_ULONGS convert_ulong16
#endif

// dark + flat light, without noise, on the ideal grid.
LANED __kernel void clean_image(
    __global const float *restrict light,
    __global const float *restrict flat,
    __global const float *restrict dark,
    __global float *restrict clean,
    const int K, const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, x, count, K * H, W)
    const int at = row * W + x;
    floats image = load_floats(light + at, count) * load_floats(flat + at, count);
    if (dark) image += load_floats(dark + row % H * W + x, count);
    store_floats(image, clean + at, count);
}

// A number between 0 and 1, without the ends, of the lower half of each word.
static floats fraction(const ulongs words)
{
    const ulongs low = words & 0xffffffffUL;
    return (TO_FLOATS(TO_INTS(low >> (32 - FRACTION_BITS))) + 0.5f) * 0x1p-23f;
}

// Eight normal deviates for each of LANES elements from the element `at` on: Philox 4x64 with as
// many rounds as NumPy's, whose first counter is 1; then Box and Muller's.
static void normal_deviates(
    const ulong seed, const ulong image, const int at, const int pairs, floats *deviates)
{
    ulongs a = TO_ULONGS(TO_INTS(LANE_NUMBERS) + (at + 1)), b = 0, c = 0, d = 0;
    ulong one = seed, two = image;
    for (int round_ = 0; round_ < PHILOX_ROUNDS; ++round_) {
        const ulongs first = 0xd2e7470ee14c6c93UL, second = 0xca5a826395121157UL;
        const ulongs high_a = mul_hi(a, first), high_c = mul_hi(c, second);
        const ulongs new_a = high_c ^ b ^ one, new_c = high_a ^ d ^ two;
        b = c * second, d = a * first;
        a = new_a, c = new_c;
        one += 0x9e3779b97f4a7c15UL, two += 0xbb67ae8584caa73bUL;
    }
    const ulongs words[MAX_LEDS / 2] = {a, b, c, d};
    for (int i = 0; i < pairs; ++i) {
        const floats radius = sqrt(-2.0f * log(fraction(words[i])));
        const floats turn = 6.2831853f * fraction(words[i] >> 32);
        deviates[2 * i] = radius * cos(turn);
        deviates[2 * i + 1] = radius * sin(turn);
    }
}

static ulong number_of(__global const float *before)
{
    return before ? 2 * (ulong)before[0] : 0;
}

// The deviates that the pixels of a cell have in common.
LANED __kernel void cell_deviates(
    __global const float *restrict before,
    const uint seed,
    __global float *restrict cells,
    const int K, const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, x, count, H, W)
    floats deviates[MAX_LEDS];
    normal_deviates(seed, number_of(before) + 1, row * W + x, (K + 1) / 2, deviates);
    for (int k = 0; k < K; ++k) store_floats(deviates[k], cells + (k * H + row) * W + x, count);
}

// Images through the lens, with noise, quantised as by the camera.
LANED __kernel void expose(
    __global const float *restrict clean,
    __global const float *restrict noise,
    __global const float *restrict lens,
    __global const float *restrict before,
    const uint seed,
    __global const float *restrict cells,
    __global float *restrict out,
    __global float *restrict taken,
    const int K, const int H, const int W, const int h, const int w,
    const float alike, const int noisy, const int full)
{
    GRID_PARTS_OF_ROWS(row, x, count, H, W)
    const int at = row * W + x, bent = lens && is_bent(lens);
    const float shot = noise[0], read = noise[1], steps = (float)full;
    const floats none = 0.0f, one = 1.0f;
    if (at == 0) taken[0] = (before ? before[0] : 0.0f) + 1.0f;
    Taps taps;
    if (bent) {
        floats u, v;
        ideal_places(lens, row, x, H, W, &u, &v);
        find_taps(u, v, x, H, W, &taps);
    }
    floats deviates[MAX_LEDS], grain[MAX_LEDS];
    if (noisy && cells) between_cells(cells, row, x, count, GRAIN_CELL_PX, h, w, K, grain);
    if (noisy) normal_deviates(seed, number_of(before), at, (K + 1) / 2, deviates);
    for (int k = 0; k < K; ++k) {
        __global const float *plane = clean + k * H * W;
        floats image = bent ? value_at(plane, &taps, H, W) : load_floats(plane + at, count);
        if (noisy) {
            floats deviate = deviates[k];
            if (cells) deviate += alike * grain[k];
            image += sqrt(shot * MORE_OF(image, none) + read) * deviate;
        }
        const floats level = rint(LESS_OF(MORE_OF(image, none), one) * steps) / steps;
        store_floats(level, out + k * H * W + at, count);
    }
}
