// Equation F4 of docs/model.md.
#include "common.clh"
// The tolerance allows it, and it takes a twentieth less.
#pragma OPENCL FP_CONTRACT ON
#include "lanes.clh"
#include "near_light.clh"
#include "film.clh"

// Light before `unwrapped`, and its standard deviation.
static void put(
    const floats light, floats sigma, const float wrap, __global float *light_,
    __global float *sigma_, const int i, const int count)
{
    store_floats(unwrapped(light, &sigma, wrap), light_ + i, count);
    store_floats(sigma, sigma_ + i, count);
}

// The light of a real film converted to that of a matt one.  A work-item does STRETCH_PX pixels of
// a row, LANES at a time: on CPUs its data of each LED stay in the same memory, near the core.
LANED __kernel void matt_light(
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict slope,
    __global const float *restrict height,
    FILM_PARAMETERS,
    const float film_grain,
    const float pixel,
    __global const float *restrict bounced,
    __global const float *restrict resting,
    __global float *restrict light_,
    __global float *restrict sigma_,
    const int K, const int H, const int W,
    const int steps, const int uncoated_steps)
{
    const int item = get_global_id(0), across = (W + STRETCH_PX - 1) / STRETCH_PX;
    const int row = item / across;
    if (row >= H) return;
    const int first = STRETCH_PX * (item - row * across), past = min(first + STRETCH_PX, W);
    const int size = H * W, harmonic = any_harmonic(film_harmonics, K);
    const Film film = FILM_OF(K, harmonic);
    const int turns = film_refraction == 1.0f ? uncoated_steps : steps;
    const int affine = film_refraction == 1.0f && film_camera == 0.0f && !harmonic;
    const float y0 = ((float)row - 0.5f * (float)(H - 1)) * pixel;
    Stretch rows[MAX_LEDS];
    const float x0 = ((float)first - 0.5f * (float)(W - 1)) * pixel;
    for (int k = 0; k < K; ++k) set_stretch(rows + k, &film, k, x0, y0, pixel);

    for (int x = first; x < past; x += LANES) {
        const int at = row * W + x, count = min(LANES, past - x);
        const floats apparent = load_floats(height + at, count);
        const floats u = ((float)x + LANE_NUMBERS - 0.5f * (float)(W - 1)) * pixel, v = y0;
        const floats z = apparent / (1.0f + film_camera * apparent), nearer = 1.0f - film_camera * z;
        const Places here = {u * nearer, v * nearer, z, u, v};
        // Film is touched where it is above the film at rest; on a plane that is its height.
        const floats lift = resting ? apparent - load_floats(resting + at, count) : apparent;
        const floats lifted = touch_gain(&film, lift);
        floats shown[MAX_LEDS], shine[MAX_LEDS], scale[MAX_LEDS], spread[MAX_LEDS];
        for (int k = 0; k < K; ++k) {
            const int i = k * size + at;
            FETCH_AHEAD(light + i, 0);
            FETCH_AHEAD(sigma + i, 0);
            if (bounced) FETCH_AHEAD(bounced + i, 0);
            FETCH_AHEAD(light_ + i, 1);
            FETCH_AHEAD(sigma_ + i, 1);
            shown[k] = load_floats(light + i, count);
            if (bounced) shown[k] -= load_floats(bounced + i, count);
            shine[k] = emitted(&film, k, &here);
            scale[k] = reciprocal(lifted * direct_share(&film, k) * shine[k]);
            const floats noise = load_floats(sigma + i, count), grain = film_grain * shown[k];
            spread[k] = sqrt(noise * noise + grain * grain) * scale[k];
            if (affine) {
                const floats direct = shown[k] - lifted * film_diffuse[k];
                put(direct * scale[k], spread[k], film_wrap, light_, sigma_, i, count);
            }
        }
        if (affine) continue;

        const Vector eye = to_pupil(&film, here.x, here.y, z);
        const floats touched = touch_gain(&film, resting ? lift : z), per_touch_there = reciprocal(touched);
        const floats p = load_floats(slope + at, count);
        const floats q = load_floats(slope + size + at, count);
        Vector n = unit(-p, -q, (floats)1.0f);
        AtPlace at_place[MAX_LEDS];
        floats weight[MAX_LEDS];
        for (int k = 0; k < K; ++k) {
            const float diffuse = film_diffuse[k], direct = 1.0f / direct_share(&film, k);
            const floats rest = per_rest(rows + k, (x - first) / LANES);
            set_place(at_place + k, &film, k, eye, &here, touched, shine[k], rest, rows + k);
            weight[k] = weight_of((shown[k] * per_touch_there - diffuse) * direct, shown[k]);
            shown[k] -= touched * diffuse;
        }
        floats expected[MAX_LEDS];
        int far = 1;
        for (int step = 0; far && step < turns; ++step)
            far = turned(&film, shown, weight, at_place, &n, eye, expected);
        const Facing facing = facing_of(&film, n, eye);
        for (int k = 0; k < K; ++k) {
            const int i = k * size + at;
            if (film_refraction == 1.0f && film_camera == 0.0f && film_diffuse[k] < MAX_DIFFUSE) {
                // What a matt film has there, the harmonics stand beside.
                const floats beside = shaded(&film, at_place + k, &facing);
                const floats result = (shown[k] - beside) * scale[k];
                put(result, spread[k], film_wrap, light_, sigma_, i, count);
                continue;
            }
            const Vector to = light_vector(film_lights + 3 * k, u, v, apparent);
            const floats matt = wrapped(dot_of(to, n), film_wrap);
            const floats there = far ? predicted(&film, at_place + k, &facing) : expected[k];
            put((shown[k] - there) * scale[k] + matt, spread[k], film_wrap, light_, sigma_, i, count);
        }
    }
}
