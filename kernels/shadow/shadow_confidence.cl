#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"
#include "label_edges.clh"

#define MIN_EXPECTED_LIGHT 0.02f

// The share of the expected light that is present, minus a half; noisy light counts less.
static floats share_of(const floats light, const floats sigma, const floats shown, const float half_weight_sigmas)
{
    const floats none = 0.0f, one = 1.0f, faintest = MIN_EXPECTED_LIGHT;
    const floats expected = MORE_OF(shown, faintest);
    const floats square = expected * expected, doubt = half_weight_sigmas * sigma, there = light / expected;
    return (LESS_OF(MORE_OF(there, none), one) - 0.5f) * (square / (square + doubt * doubt));
}

// The probability that the labels of all LEDs are right.
LANED __kernel void shadow_confidence(
    __global const uchar *restrict shadow,
    __global const uchar *restrict image_labels,
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict lights,
    const float pixel,
    __global float *restrict out,
    const int H, const int W, const int K,
    const float base_odds,
    const float light_odds,
    const float edge_odds,
    const float near_edge_odds,
    const float contradicted_odds,
    const float half_weight_sigmas)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int size = H * W, i = row * W + column;
    const floats x = ((float)column + LANE_NUMBERS - 0.5f * (float)(W - 1)) * pixel;
    const floats y = ((float)row - 0.5f * (float)(H - 1)) * pixel;
    const floats z = load_floats(height + i, count), p = load_floats(slope + i, count);
    const floats q = load_floats(slope + size + i, count), nz = 1.0f / sqrt(1.0f + p * p + q * q);
    const ints label = load_bytes(shadow + i, count), differs = label ^ load_bytes(image_labels + i, count);
    const ints near = edges(shadow, row, column, count, H, W, 2);
    ints edge = 0;
    if (ANY(near != 0)) edge = edges(shadow, row, column, count, H, W, 1);
    const floats none = 0.0f, by_image = light_odds, contradicted = contradicted_odds;
    const floats lost_at_edge = edge_odds, lost_near_edge = near_edge_odds;
    floats sure_of_all = 1.0f;
    for (int k = 0; k < K; ++k) {
        const Vector v = light_vector(lights + 3 * k, x, y, z);
        const floats shown = (v.z - v.x * p - v.y * q) * nz;
        const floats lit = share_of(
            load_floats(light + k * size + i, count), load_floats(sigma + k * size + i, count),
            shown, half_weight_sigmas);
        const ints led = 1 << k;
        const floats favour = (label & led) != 0 ? -lit : lit;
        floats odds = base_odds + favour * ((differs & led) != 0 ? contradicted : by_image);
        const floats beside = (near & led) != 0 ? lost_near_edge : none;
        odds -= (edge & led) != 0 ? lost_at_edge : beside;
        sure_of_all *= 1.0f / (1.0f + exp(-odds));
    }
    store_floats(sure_of_all, out + i, count);
}
