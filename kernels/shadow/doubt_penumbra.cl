// Equation P1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define BAND_DEVIATIONS 1.645f
#define MIN_MATT_LIGHT 0.05f
#define EDGE_DEVIATIONS 4.0f
#define PIXEL_VARIANCE (1.0f / 12.0f)

// Whether a pixel up to `reach` px away, towards the LED, is dark.
static int before_dark(
    __global const float *light, __global const float *led, const int y, const int x, const int H,
    const int W, const float pixel, const float reach)
{
    const float dx = led[0] / pixel - ((float)x - 0.5f * (float)(W - 1));
    const float dy = led[1] / pixel - ((float)y - 0.5f * (float)(H - 1));
    const float plan = copysign(sqrt(dx * dx + dy * dy) + 1e-6f, led[2]);
    for (float t = 1.0f; t <= reach; ++t) {
        const int column = (int)rint((float)x + t * dx / plan);
        const int row = (int)rint((float)y + t * dy / plan);
        if (column < 0 || column >= W || row < 0 || row >= H) return 0;
        if (light[row * W + column] < MIN_MATT_LIGHT) return 1;
    }
    return 0;
}

// Whether a block of pixels holds dark film, for each LED.
__kernel void mark_dark(
    __global const float *restrict light, __global uchar *restrict dark, const int K, const int H,
    const int W, const int side)
{
    GRID_3(k, row, column, K, (H + side - 1) / side, (W + side - 1) / side)
    int any_ = 0;
    for (int y = row * side; y < min((row + 1) * side, H); ++y)
        for (int x = column * side; x < min((column + 1) * side, W); ++x)
            any_ |= light[(k * H + y) * W + x] < MIN_MATT_LIGHT;
    dark[(k * ((H + side - 1) / side) + row) * ((W + side - 1) / side) + column] = any_;
}

// Whether film may be dark up to `reach` px from `count` pixels of a row.
static int dark_near(
    __global const uchar *dark, const int y, const int x, const int count, const int reach,
    const int H, const int W, const int side)
{
    const int across = (W + side - 1) / side;
    int any_ = 0;
    for (int row = max(y - reach, 0) / side; row <= min(y + reach, H - 1) / side; ++row)
        for (int column = max(x - reach, 0) / side; column <= min(x + count - 1 + reach, W - 1) / side; ++column)
            any_ |= dark[row * across + column];
    return any_;
}

// The deviation of the light, with what is missing of it before dark film.
LANED __kernel void doubt_penumbra(
    __global const float *restrict sigma, __global const float *restrict light,
    __global const float *restrict lights, __global const float *restrict height,
    __global const float *restrict slope, __global const float *restrict leds, const float pixel,
    const float blur, const float refraction, __global const float *restrict diffuse,
    __global const uchar *restrict dark, __global float *restrict out, const int K, const int H,
    const int W, const int side)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, i = row * W + column;
    const float reach = ceil(EDGE_DEVIATIONS * sqrt(blur * blur + PIXEL_VARIANCE));
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats steep = sqrt(1.0f + p * p + q * q), none = 0.0f;
    const floats z = load_floats(height + i, count);
    int hard = refraction == 1.0f;
    for (int k = 0; k < K; ++k) hard = hard && diffuse[k] == 0.0f;
    floats x, y;
    places(i, H, W, pixel, &x, &y);
    for (int k = 0; k < K; ++k) {
        const int at = k * size + i;
        const floats spread = load_floats(sigma + at, count);
        store_floats(spread, out + at, count);
        __global const uchar *blocks = dark + k * ((H + side - 1) / side) * ((W + side - 1) / side);
        if (!hard || !dark_near(blocks, row, column, count, (int)reach, H, W, side)) continue;
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats faced = (v.z - p * v.x - q * v.y) / steep;
        const floats missing = faced - load_floats(light + at, count) - BAND_DEVIATIONS * spread;
        if (!ANY(missing > none)) continue;
        float each[LANES];
        STORE_LANES(missing, each);
        for (int l = 0; l < count; ++l) {
            if (each[l] <= 0.0f) continue;
            if (!before_dark(light + k * size, leds + 3 * k, row, column + l, H, W, pixel, reach)) continue;
            const float own = sigma[at + l];
            out[at + l] = sqrt(own * own + each[l] * each[l]);
        }
    }
}
