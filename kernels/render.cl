#include "common.clh"

#define GOLDEN_ANGLE 2.3999631f
#define LIFT_PX 1e-3f

// Central difference, one-sided at the border, 0 on a single pixel.
float difference(const float after, const float before, const int steps, const float pixel)
{
    return (after - before) / ((float)max(steps, 1) * pixel);
}

// How far a coordinate lies outside the image, mm; 0 inside.
float outside(const float foot, const int size, const float pixel)
{
    return fmax(fabs(foot) - 0.5f * (float)(size - 1) * pixel, 0.0f);
}

// Irradiance of the flat film under an LED: at the image's point nearest to the LED's foot.
float flat_irradiance(
    const float x, const float y, const float z,
    const int H, const int W, const float pixel, const int distant)
{
    if (distant)
        return z / sqrt(x * x + y * y + z * z);
    const float dx = outside(x, W, pixel), dy = outside(y, H, pixel);
    const float square = dx * dx + dy * dy + z * z;
    return z / (square * sqrt(square));
}

// Bilinear interpolation at a point inside the image.
float interpolated(__global const float *restrict height, const float x, const float y,
                   const int H, const int W)
{
    const int left = (int)x, top = (int)y;
    const int right = min(left + 1, W - 1), bottom = min(top + 1, H - 1);
    const float fx = x - (float)left, fy = y - (float)top;
    const float a = height[top * W + left], b = height[top * W + right];
    const float c = height[bottom * W + left], d = height[bottom * W + right];
    const float upper = a + fx * (b - a), lower = c + fx * (d - c);
    return upper + fy * (lower - upper);
}

// Whether the ray from pixel (x, y) along (rx, ry, rz) meets no surface.
int unobstructed(__global const float *restrict height, const int x, const int y,
                 const float rx, const float ry, const float rz,
                 const int H, const int W, const float pixel, const int distant,
                 const float step_px)
{
    const float start = height[y * W + x] + LIFT_PX * pixel;
    const float across = fmax(sqrt(rx * rx + ry * ry), 1e-6f);
    const float dx = rx / across * step_px, dy = ry / across * step_px;
    const float dz = rz / across * step_px * pixel;
    // The LED itself ends a ray; rays to a distant one end at the border of the image.
    const float last = distant ? INFINITY : across / (step_px * pixel);
    // NumPy stops above the highest point, where nothing can be met: the same answer.
    for (float i = 1.0f; i < last; i += 1.0f) {
        const float px = (float)x + i * dx, py = (float)y + i * dy;
        if (px < 0.0f || px > (float)(W - 1) || py < 0.0f || py > (float)(H - 1))
            return 1;
        if (interpolated(height, px, py, H, W) > start + i * dz)
            return 0;
    }
    return 1;
}

// The image under each LED, and the labels of those that do not reach the pixel.
__kernel void render(
    __global const float *restrict height,
    const float pixel,
    __global const float *restrict lights,
    __global float *restrict light,
    __global uchar *restrict labels,
    const int H, const int W, const int K,
    const int distant, const float level, const float gloss, const float shininess,
    const float led_size_mm, const int rays, const float step_px)
{
    GRID_2(y, x, H, W)
    const int left = max(x - 1, 0), right = min(x + 1, W - 1);
    const int above = max(y - 1, 0), below = min(y + 1, H - 1);
    const float p = difference(height[y * W + right], height[y * W + left], right - left,
                               pixel);
    const float q = difference(height[below * W + x], height[above * W + x], below - above,
                               pixel);
    const float norm = sqrt(1.0f + p * p + q * q);
    const float mm_x = ((float)x - 0.5f * (float)(W - 1)) * pixel;
    const float mm_y = ((float)y - 0.5f * (float)(H - 1)) * pixel;
    const float mm_z = height[y * W + x];

    float brightest = 0.0f;
    for (int k = 0; k < K; k++)
        brightest = fmax(brightest, flat_irradiance(lights[3 * k], lights[3 * k + 1],
                                                    lights[3 * k + 2], H, W, pixel,
                                                    distant));
    const float gain = level / brightest;

    const int count = led_size_mm > 0.0f ? rays : 1;
    uchar label = 0;
    for (int k = 0; k < K; k++) {
        float total = 0.0f;
        int reached = 0;
        for (int i = 0; i < count; i++) {
            // Points of a sunflower spiral over the LED's disk; a single one is its centre.
            const float radius = 0.5f * led_size_mm * sqrt((float)i / (float)count);
            const float angle = (float)i * GOLDEN_ANGLE;
            const float led_x = lights[3 * k] + radius * cos(angle);
            const float led_y = lights[3 * k + 1] + radius * sin(angle);
            const float led_z = lights[3 * k + 2];
            float rx, ry, rz;
            if (distant) {
                const float far = sqrt(led_x * led_x + led_y * led_y + led_z * led_z);
                rx = led_x / far, ry = led_y / far, rz = led_z / far;
            } else {
                rx = led_x - mm_x, ry = led_y - mm_y, rz = led_z - mm_z;
            }
            const float length = sqrt(rx * rx + ry * ry + rz * rz);
            const float cosine = (rz - p * rx - q * ry) / (norm * length);
            if (!(cosine > 0.0f) || !unobstructed(height, x, y, rx, ry, rz, H, W, pixel,
                                                  distant, step_px))
                continue;
            float radiance = cosine;
            if (gloss > 0.0f) {
                // Blinn-Phong; h lies half-way between the light and the camera above.
                const float hx = rx / length, hy = ry / length, hz = rz / length + 1.0f;
                const float h = norm * sqrt(hx * hx + hy * hy + hz * hz);
                const float n_h = fmax((hz - p * hx - q * hy) / h, 0.0f);
                radiance += gloss * pow(n_h, shininess);
            }
            total += distant ? radiance : radiance * (1.0f / (length * length));
            reached++;
        }
        light[(k * H + y) * W + x] = gain * total / (float)count;
        if (2 * reached < count)
            label |= (uchar)(1 << k);
    }
    labels[y * W + x] = label;
}
