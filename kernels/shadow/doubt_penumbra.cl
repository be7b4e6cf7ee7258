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

// The deviation of the light, with what is missing of it before dark film.
LANED __kernel void doubt_penumbra(
    __global const float *restrict sigma, __global const float *restrict light,
    __global const float *restrict lights, __global const float *restrict height,
    __global const float *restrict slope, __global const float *restrict leds, const float pixel,
    const float blur, const float refraction, __global const float *restrict diffuse,
    __global float *restrict out, const int K, const int H, const int W)
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
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats faced = (v.z - p * v.x - q * v.y) / steep, spread = load_floats(sigma + at, count);
        const floats here = load_floats(light + at, count);
        const floats missing = faced - here - BAND_DEVIATIONS * spread;
        store_floats(spread, out + at, count);
        if (!hard || !ANY(missing > none)) continue;
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
