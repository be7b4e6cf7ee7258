// Equation F1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "film.clh"

// The light of a film of known shape.  A work-item does STRETCH_PX pixels of a row.
LANED __kernel void film_light(
    __global const float *restrict slope,
    __global const float *restrict height,
    FILM_PARAMETERS,
    const float pixel,
    __global const uchar *restrict shadow,
    __global const float *restrict resting,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    const int item = get_global_id(0), across = (W + STRETCH_PX - 1) / STRETCH_PX;
    const int row = item / across;
    if (row >= H) return;
    const int first = STRETCH_PX * (item - row * across), past = min(first + STRETCH_PX, W);
    const int size = H * W, harmonic = any_harmonic(film_harmonics, K);
    const Film film = FILM_OF(K, harmonic);
    const float y0 = ((float)row - 0.5f * (float)(H - 1)) * pixel;
    const floats one = 1.0f;
    Stretch rows[MAX_LEDS];
    const float x0 = ((float)first - 0.5f * (float)(W - 1)) * pixel;
    for (int k = 0; k < K; ++k) set_stretch(rows + k, &film, k, x0, y0, pixel);

    for (int x = first; x < past; x += LANES) {
        const int at = row * W + x, count = min(LANES, past - x);
        const floats apparent = load_floats(height + at, count);
        const floats u = ((float)x + LANE_NUMBERS - 0.5f * (float)(W - 1)) * pixel, v = y0;
        const floats z = apparent / (1.0f + film_camera * apparent), nearer = 1.0f - film_camera * z;
        const Places here = {u * nearer, v * nearer, z, u, v};
        const Vector eye = to_pupil(&film, here.x, here.y, z);
        const floats lift = resting ? apparent - load_floats(resting + at, count) : z;
        const floats touched = touch_gain(&film, lift);
        const floats p = load_floats(slope + at, count);
        const floats q = load_floats(slope + size + at, count);
        const Facing facing = facing_of(&film, unit(-p, -q, one), eye);
        const ints dark = shadow ? load_bytes(shadow + at, count) : (ints)(0);
        for (int k = 0; k < K; ++k) {
            AtPlace at_place;
            const floats shine = emitted(&film, k, &here);
            const floats rest = per_rest(rows + k, (x - first) / LANES);
            set_place(&at_place, &film, k, eye, &here, touched, shine, rest, rows + k);
            const floats diffused = touched * film_diffuse[k], remainder = diffused - at_place.wrap;
            const floats lit = diffused + predicted(&film, &at_place, &facing);
            const floats light = (dark >> k & 1) == 0 ? lit : remainder;
            store_floats(light, out + k * size + at, count);
        }
    }
}
