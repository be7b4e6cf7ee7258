#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

#define MAX_LEDS 8
#define DARK_LIGHT 0.05f
#define MIN_LIGHT 1e-3f
#define MIN_ERROR 0.0015f
#define UNEVEN_SHARE 0.25f
#define MIN_FREEDOM 0.5f
#define NOT_TESTED (-1.0f)

// The reduced chi-squared of the light of LANES pixels under their slopes, equation T1, and the
// excess of their brightness, T4.
LANED __kernel void light_departure(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const uchar *restrict used,
    __global const float *restrict lights,
    __global const float *restrict misfit,
    const float pixel,
    const float uneven,
    __global float *restrict departure,
    __global float *restrict brighter,
    const int K, const int H, const int W,
    const int cell_px)
{
    const int size = H * W;
    GRID_LANES(at, count, size)
    const floats p = load_floats(slope + at, count), q = load_floats(slope + size + at, count);
    const floats z = load_floats(height + at, count), none = 0.0f, one = 1.0f;
    const ints bits = load_bytes(used + at, count);
    const floats nz = 1.0f / sqrt(1.0f + p * p + q * q);
    const float pressed = fmax(misfit[2], MIN_ERROR), differs = UNEVEN_SHARE * uneven;
    const float error = sqrt(pressed * pressed + differs * differs);
    const float share_of_noise = 1.0f / (float)cell_px;
    floats x, y;
    places(at, H, W, pixel, &x, &y);
    floats departs[MAX_LEDS], shown[MAX_LEDS], weight[MAX_LEDS];
    floats product = none, whole = none, leds = none, measured = none, due = none;
    for (int k = 0; k < K; ++k) {
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats bright = (v.z - v.x * p - v.y * q) * nz, darkest = DARK_LIGHT;
        const floats noise = load_floats(sigma + k * size + at, count) * share_of_noise;
        const floats model = error * MORE_OF(bright, darkest);
        const floats lit = ((bits >> k) & 1) != 0 ? one : none;
        const floats value = load_floats(light + k * size + at, count);
        departs[k] = value - bright;
        shown[k] = bright;
        weight[k] = lit / (noise * noise + model * model);
        product += departs[k] * (bright * weight[k]);
        whole += bright * (bright * weight[k]);
        leds += lit;
        measured += value * bright * lit;
        due += bright * bright * lit;
    }
    const floats one_scale = 1.0f, share = brightness_share(whole, one_scale, uneven);
    floats chi = none;
    for (int k = 0; k < K; ++k) {
        const floats residual = departs[k] - product * share * shown[k];
        chi += weight[k] * residual * residual;
    }
    const floats freedom = leds - 2.0f - share * whole, smallest = MIN_FREEDOM, untested = NOT_TESTED;
    const floats reduced = chi / MORE_OF(freedom, smallest);
    store_floats(freedom >= smallest ? reduced : untested, departure + at, count);
    const floats least = MIN_LIGHT;
    store_floats(measured / MORE_OF(due, least) - 1.0f, brighter + at, count);
}
