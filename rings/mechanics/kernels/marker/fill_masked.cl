#include "common.clh"

// The light where the mask is set, else the value of a plane fitted to the known surroundings,
// weighted by their distance; limited to the range from 0 to twice the mean around.
__kernel void fill_masked(
    __global const float *restrict light,
    __global const uchar *restrict mask,
    __global const float *restrict taps,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int radius, const float least, const float held)
{
    GRID_3(k, y, x, K, H, W)
    const int pixel = y * W + x;
    __global const float *plane = light + k * H * W;
    float value = plane[pixel];
    if (!mask[pixel]) {
        // Sums of 1, x, y, x^2, y^2, x y; and of the light, times 1, x, y.
        float s = 0.0f, sx = 0.0f, sy = 0.0f, sxx = 0.0f, syy = 0.0f, sxy = 0.0f;
        float t = 0.0f, tx = 0.0f, ty = 0.0f;
        for (int j = max(y - radius, 0); j <= min(y + radius, H - 1); ++j)
            for (int i = max(x - radius, 0); i <= min(x + radius, W - 1); ++i) {
                if (!mask[j * W + i]) continue;
                const float dx = (float)(i - x), dy = (float)(j - y);
                const float w = taps[i - x + radius] * taps[j - y + radius];
                const float v = w * plane[j * W + i];
                s += w, sx += w * dx, sy += w * dy;
                sxx += w * dx * dx, syy += w * dy * dy, sxy += w * dx * dy;
                t += v, tx += v * dx, ty += v * dy;
            }
        if (s > least) {
            const float mx = sx / s, my = sy / s, middle = t / s;
            const float xx = sxx / s - mx * mx + held, yy = syy / s - my * my + held;
            const float xy = sxy / s - mx * my, inverse = 1.0f / (xx * yy - xy * xy);
            const float by_x = tx / s - middle * mx, by_y = ty / s - middle * my;
            const float p = (by_x * yy - by_y * xy) * inverse;
            const float q = (by_y * xx - by_x * xy) * inverse;
            value = middle - p * mx - q * my;
            value = fmin(fmax(value, 0.0f), 2.0f * fmax(middle, 0.0f));
        }
    }
    out[k * H * W + pixel] = value;
}
