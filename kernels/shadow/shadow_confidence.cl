#include "common.clh"
#include "expected_light.clh"

#define FAINTEST 0.02f

// The LEDs whose label is not the same all over the pixels `reach` away, or nearer.
static uchar edges(
    __global const uchar *labels, const int y, const int x, const int H, const int W,
    const int reach)
{
    uchar some = 0, every = 255;
    for (int row = max(y - reach, 0); row <= min(y + reach, H - 1); ++row)
        for (int column = max(x - reach, 0); column <= min(x + reach, W - 1); ++column) {
            some |= labels[row * W + column];
            every &= labels[row * W + column];
        }
    return some & ~every;
}

// The share of the light to be expected of a film of slope p, q that is there, less a half.
static float share_of(
    const float light, const float sigma, __global const float *led, const float x, const float y,
    const float z, const float p, const float q, const float noisy)
{
    const float expected = fmax(expected_light(led, x, y, z, p, q), FAINTEST);
    const float square = expected * expected, doubt = noisy * sigma;
    return (clamp(light / expected, 0.0f, 1.0f) - 0.5f) * (square / (square + doubt * doubt));
}

// The probability that the labels of all LEDs are right.
__kernel void shadow_confidence(
    __global const uchar *restrict shadow,
    __global const uchar *restrict seen,
    __global const float *restrict light,
    __global const float *restrict sigma,
    __global const float *restrict slope,
    __global const float *restrict height,
    __global const float *restrict lights,
    const float pixel,
    __global float *restrict out,
    const int H, const int W, const int K,
    const float sure,
    const float by_light,
    const float at_edge,
    const float near_edge,
    const float by_light_contradicted,
    const float noisy)
{
    GRID_2(row, column, H, W)
    const int size = H * W, i = row * W + column;
    const float x = ((float)column - 0.5f * (float)(W - 1)) * pixel;
    const float y = ((float)row - 0.5f * (float)(H - 1)) * pixel;
    const uchar label = shadow[i], differs = label ^ seen[i];
    const uchar edge = edges(shadow, row, column, H, W, 1);
    const uchar near = edges(shadow, row, column, H, W, 2);
    float sure_of_all = 1.0f;
    for (int k = 0; k < K; ++k) {
        const float lit = share_of(
            light[k * size + i], sigma[k * size + i], lights + 3 * k, x, y, height[i], slope[i],
            slope[size + i], noisy);
        const float favour = label >> k & 1 ? -lit : lit;
        const int other = differs >> k & 1;
        float odds = sure + favour * (other ? by_light_contradicted : by_light);
        odds -= edge >> k & 1 ? at_edge : near >> k & 1 ? near_edge : 0.0f;
        sure_of_all *= 1.0f / (1.0f + exp(-odds));
    }
    out[i] = sure_of_all;
}
