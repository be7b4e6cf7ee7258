#include "common.clh"
#include "extent.clh"
#include "bilinear.clh"
#define reals float
#include "coat.clh"

#define GOLDEN_ANGLE 2.3999631f
#define LIFT_PX 1e-3f
#define MIN_COAT_COSINE 1e-3f

typedef struct {
    __global const float *height;
    int H, W;
    float pixel, top;
} Surface;

// A point of a pixel: its position in px and in mm, and its slope.
typedef struct {
    float column, row;
    float x, y, z;
    float p, q, norm;
} Spot;

// From a spot towards an LED, mm.
typedef struct {
    float x, y, z, length;
} Ray;

// Central difference, one-sided at the border, 0 on a single pixel.
float difference(const float before, const float after, const int steps, const float pixel)
{
    return (after - before) / ((float)max(steps, 1) * pixel);
}

float slope_x(const Surface s, const int x, const int y)
{
    const int left = max(x - 1, 0), right = min(x + 1, s.W - 1);
    return difference(s.height[y * s.W + left], s.height[y * s.W + right], right - left, s.pixel);
}

float slope_y(const Surface s, const int x, const int y)
{
    const int above = max(y - 1, 0), below = min(y + 1, s.H - 1);
    return difference(s.height[above * s.W + x], s.height[below * s.W + x], below - above,
                      s.pixel);
}

Spot spot_at(const Surface s, const float column, const float row)
{
    Spot spot;
    spot.column = clamp(column, 0.0f, (float)(s.W - 1));
    spot.row = clamp(row, 0.0f, (float)(s.H - 1));
    const int left = (int)spot.column, top = (int)spot.row;
    const int right = min(left + 1, s.W - 1), bottom = min(top + 1, s.H - 1);
    const Around at = around(spot.column, spot.row, s.H, s.W);
    spot.x = (spot.column - 0.5f * (float)(s.W - 1)) * s.pixel;
    spot.y = (spot.row - 0.5f * (float)(s.H - 1)) * s.pixel;
    spot.z = bilinear(s.height, at);
    spot.p = between(at, slope_x(s, left, top), slope_x(s, right, top),
                     slope_x(s, left, bottom), slope_x(s, right, bottom));
    spot.q = between(at, slope_y(s, left, top), slope_y(s, right, top),
                     slope_y(s, left, bottom), slope_y(s, right, bottom));
    spot.norm = sqrt(1.0f + spot.p * spot.p + spot.q * spot.q);
    return spot;
}

// How far a coordinate lies outside the image, mm; 0 inside.
float outside(const float foot, const int size, const float pixel)
{
    return fmax(fabs(foot) - 0.5f * (float)(size - 1) * pixel, 0.0f);
}

typedef struct {
    float alpha, index, albedo, camera_mm;
    __global const float *let_in;
} Coat;

// Irradiance of the flat film under an LED, at the image point nearest to the LED's foot.
float flat_irradiance(const Surface s, const float x, const float y, const float z)
{
    const float dx = outside(x, s.W, s.pixel), dy = outside(y, s.H, s.pixel);
    const float square = dx * dx + dy * dy + z * z;
    return z / (square * sqrt(square));
}

// The exposure: `level` divided by the largest flat irradiance.
float exposure(const Surface s, __global const float *lights, const int K, const float level)
{
    float brightest = 0.0f;
    for (int k = 0; k < K; k++)
        brightest = fmax(
            brightest, flat_irradiance(s, lights[3 * k], lights[3 * k + 1], lights[3 * k + 2]));
    return level / brightest;
}

// Ray to point i of `count` on sunflower spirals over an LED's disk, which faces the middle of the
// film or lies parallel to it.  Points come in opposite pairs; an odd one lies at the centre.
Ray towards(const Spot spot, __global const float *led, const float size_mm, const int i,
            const int count, const int facing)
{
    const int odd = count % 2, pair = (i + odd) / 2;
    const float side = (i + odd) % 2 ? -1.0f : 1.0f;
    const float inside = (2.0f * (float)pair + (float)(1 - odd)) / (float)count;
    const float radius = 0.5f * size_mm * sqrt(inside) * side;
    const float angle = (float)pair * GOLDEN_ANGLE;
    const float u = radius * cos(angle), v = radius * sin(angle);
    float x = led[0], y = led[1], z = led[2];
    if (facing) {
        const float plan = sqrt(x * x + y * y), far_ = sqrt(x * x + y * y + z * z);
        const float c = plan > 0.0f ? x / plan : 1.0f, s = plan > 0.0f ? y / plan : 0.0f;
        const float flatter = z / far_;
        x += v * c * flatter - u * s;
        y += v * s * flatter + u * c;
        z -= v * plan / far_;
    } else {
        x += u;
        y += v;
    }
    Ray ray = {x - spot.x, y - spot.y, z - spot.z, 0.0f};
    ray.length = sqrt(ray.x * ray.x + ray.y * ray.y + ray.z * ray.z);
    return ray;
}

// n.L, negative in an attached shadow.
float cosine(const Spot spot, const Ray ray)
{
    return (ray.z - spot.p * ray.x - spot.q * ray.y) / (spot.norm * ray.length);
}

// Cosine between a ray and the axis of the LED's disk: relative emission along the ray.
float emitted(__global const float *led, const Ray ray)
{
    const float far_ = sqrt(led[0] * led[0] + led[1] * led[1] + led[2] * led[2]);
    const float along = (led[0] * ray.x + led[1] * ray.y + led[2] * ray.z) / far_;
    return fmax(along / ray.length, 0.0f);
}

// The replacement of n.L under a rough dielectric coat, seen from the pupil.
float coated(const Spot spot, const Ray ray, const float n_l, const Coat coat)
{
    const float lx = ray.x / ray.length, ly = ray.y / ray.length, lz = ray.z / ray.length;
    float vx = 0.0f, vy = 0.0f, vz = 1.0f;
    if (coat.camera_mm != 0.0f) {
        const float up = coat.camera_mm - spot.z;
        const float length_ = sqrt(spot.x * spot.x + spot.y * spot.y + up * up);
        vx = -spot.x / length_, vy = -spot.y / length_, vz = up / length_;
    }
    const float view_cosine = fmax((vz - spot.p * vx - spot.q * vy) / spot.norm, MIN_COAT_COSINE);
    const float lit = fmax(n_l, MIN_COAT_COSINE);
    const float hx = lx + vx, hy = ly + vy, hz = lz + vz;
    const float length_ = sqrt(hx * hx + hy * hy + hz * hz);
    const float upright =
        fmax((hz - spot.p * hx - spot.q * hy) / (spot.norm * length_), MIN_COAT_COSINE);
    const float between = (vx * hx + vy * hy + vz * hz) / length_;
    const float mirrored = beckmann(upright, coat.alpha) * fresnel(between, coat.index)
        * lit * unhidden_by(lit, coat.alpha) * unhidden_by(view_cosine, coat.alpha);
    const float matt = n_l * let_in_by(coat.let_in, fmax(lit, MIN_COSINE))
        * let_in_by(coat.let_in, fmax(view_cosine, MIN_COSINE));
    return matt + mirrored * PI_ / (4.0f * coat.albedo);
}

// Blinn-Phong; h lies half-way between the light and the camera above.
float highlight(const Spot spot, const Ray ray, const float gloss, const float shininess)
{
    if (gloss == 0.0f)
        return 0.0f;
    const float hx = ray.x / ray.length, hy = ray.y / ray.length;
    const float hz = ray.z / ray.length + 1.0f;
    const float norm = spot.norm * sqrt(hx * hx + hy * hy + hz * hz);
    const float n_h = (hz - spot.p * hx - spot.q * hy) / norm;
    return gloss * pow(fmax(n_h, 0.0f), shininess);
}

// Whether a ray reaches its end without meeting the surface.
int unobstructed(const Surface s, const Spot spot, const Ray ray, const float step)
{
    const float start = spot.z + LIFT_PX * s.pixel;
    const float across = fmax(sqrt(ray.x * ray.x + ray.y * ray.y), 1e-6f);
    const float dx = ray.x / across * step, dy = ray.y / across * step;
    const float dz = ray.z / across * step * s.pixel;
    const float right = (float)(s.W - 1), bottom = (float)(s.H - 1);
    // A ray ends at the LED.
    const float last = across / (step * s.pixel);
    for (float i = 1.0f; i < last; i += 1.0f) {
        const float x = spot.column + i * dx, y = spot.row + i * dy, z = start + i * dz;
        if (z > s.top || x < 0.0f || x > right || y < 0.0f || y > bottom)
            return 1;
        if (bilinear(s.height, around(x, y, s.H, s.W)) > z)
            return 0;
    }
    return 1;
}

// Offset of sample i of n from the centre of its pixel.
float offset(const int i, const int n)
{
    return ((float)i + 0.5f) / (float)n - 0.5f;
}

// The image under each LED, and the labels of those that do not reach the pixel.
__kernel void render(
    __global const float *restrict height,
    const float pixel,
    __global const float *restrict lights,
    __global const float *restrict extent,
    __global const float *let_in_curve,
    __global float *restrict light,
    __global uchar *restrict labels,
    const int H, const int W, const int K,
    const float level, const float gloss, const float shininess,
    const float led_size_mm, const int rays, const int samples, const float step_px,
    const int cosine_leds, const float coat_alpha, const float refractive_index,
    const float albedo, const float camera_mm)
{
    GRID_2(y, x, H, W)
    const Surface surface = {height, H, W, pixel, extent[0]};
    const Coat coat = {coat_alpha, refractive_index, albedo, camera_mm, let_in_curve};
    const float gain = exposure(surface, lights, K, level);
    const int points = led_size_mm > 0.0f ? rays : 1;
    const int count = samples * samples * points;
    uchar label = 0;
    for (int k = 0; k < K; k++) {
        float total = 0.0f;
        int reached = 0;
        for (int j = 0; j < samples; j++)
            for (int i = 0; i < samples; i++) {
                const Spot spot = spot_at(surface, (float)x + offset(i, samples),
                                          (float)y + offset(j, samples));
                for (int n = 0; n < points; n++) {
                    const Ray ray =
                        towards(spot, lights + 3 * k, led_size_mm, n, points, cosine_leds);
                    const float n_l = cosine(spot, ray);
                    if (!(n_l > 0.0f) || !unobstructed(surface, spot, ray, step_px))
                        continue;
                    const float radiance = coat_alpha > 0.0f
                        ? coated(spot, ray, n_l, coat)
                        : n_l + highlight(spot, ray, gloss, shininess);
                    float falloff = 1.0f / (ray.length * ray.length);
                    if (cosine_leds)
                        falloff *= emitted(lights + 3 * k, ray);
                    total += radiance * falloff;
                    reached++;
                }
            }
        light[(k * H + y) * W + x] = gain * total / (float)count;
        if (2 * reached < count)
            label |= (uchar)(1 << k);
    }
    labels[y * W + x] = label;
}
