// Equation P1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "rays.clh"

#define BAND_DEVIATIONS 1.645f
#define MIN_MATT_LIGHT 0.05f
#define EDGE_DEVIATIONS 4.0f
#define PIXEL_VARIANCE (1.0f / 12.0f)

// Whether blocks of side x side pixels hold dark film, for each LED.
__kernel void mark_dark(
    __global const float *restrict light, __global uchar *restrict dark, const int K, const int H,
    const int W, const int down, const int across, const int side)
{
    GRID_3(k, row, column, K, down, across)
    int any_ = 0;
    for (int y = row * side; y < min((row + 1) * side, H); ++y)
        for (int x = column * side; x < min((column + 1) * side, W); ++x)
            any_ |= light[(k * H + y) * W + x] < MIN_MATT_LIGHT;
    dark[(k * down + row) * across + column] = any_;
}

// Whether a block within `reach` px of `count` pixels of a row holds dark film.
static int dark_near(
    __global const uchar *dark, const int y, const int x, const int count, const int reach,
    const int down, const int across, const int side)
{
    const int last_row = min((y + reach) / side, down - 1);
    const int last_column = min((x + count - 1 + reach) / side, across - 1);
    int any_ = 0;
    for (int row = max(y - reach, 0) / side; row <= last_row; ++row)
        for (int column = max(x - reach, 0) / side; column <= last_column; ++column)
            any_ |= dark[row * across + column];
    return any_;
}

// Whether a pixel up to `reach` px along a ray is dark.
static int before_dark(
    __global const float *light, const Ray ray, const int reach, const int H, const int W)
{
    for (int t = 1; t <= reach; ++t) {
        const int at = nearest(point_at(ray, (float)t), H, W);
        if (at == NO_PIXEL) return 0;
        if (light[at] < MIN_MATT_LIGHT) return 1;
    }
    return 0;
}

// The deviation of the light, with what is missing of it before dark film.
LANED __kernel void doubt_penumbra(
    __global const float *restrict sigma, __global const float *restrict light,
    __global const float *restrict lights, __global const float *restrict height,
    __global const float *restrict slope, __global const float *restrict leds, const float pixel,
    const float blur, const float refraction, __global const float *restrict diffuse,
    __global const uchar *restrict dark, __global float *restrict out, const int K, const int H,
    const int W, const int down, const int across, const int side)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, i = row * W + column;
    const int reach = (int)ceil(EDGE_DEVIATIONS * sqrt(blur * blur + PIXEL_VARIANCE));
    const floats p = load_floats(slope + i, count), q = load_floats(slope + size + i, count);
    const floats steep = sqrt(1.0f + p * p + q * q), none = 0.0f;
    const floats z = load_floats(height + i, count);
    int is_clear = refraction == 1.0f;
    for (int k = 0; k < K; ++k) is_clear = is_clear && diffuse[k] == 0.0f;
    floats x, y;
    places(i, H, W, pixel, &x, &y);
    for (int k = 0; k < K; ++k) {
        const int at = k * size + i;
        const floats spread = load_floats(sigma + at, count);
        store_floats(spread, out + at, count);
        __global const uchar *blocks = dark + k * down * across;
        if (!is_clear || !dark_near(blocks, row, column, count, reach, down, across, side)) continue;
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats faced = (v.z - p * v.x - q * v.y) / steep;
        const floats missing = faced - load_floats(light + at, count) - BAND_DEVIATIONS * spread;
        if (!ANY(missing > none)) continue;
        float each[LANES];
        STORE_LANES(missing, each);
        for (int l = 0; l < count; ++l) {
            const Ray ray = ray_towards(leds + 3 * k, row, column + l, H, W, pixel);
            if (each[l] <= 0.0f || !before_dark(light + k * size, ray, reach, H, W)) continue;
            const float own = sigma[at + l];
            out[at + l] = sqrt(own * own + each[l] * each[l]);
        }
    }
}
