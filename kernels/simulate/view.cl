#include "common.clh"
#include "extent.clh"
#include "bilinear.clh"

#define BISECTION_STEPS 24

typedef struct {
    __global const float *height;
    int H, W;
    float camera_mm;
} Scene;

// The value at a point; beyond the image its border repeats.
static float value_at(__global const float *plane, const float2 at, const int H, const int W)
{
    const float x = clamp(at.x, 0.0f, (float)(W - 1)), y = clamp(at.y, 0.0f, (float)(H - 1));
    return bilinear(plane, around(x, y, H, W));
}

// Position at height z of the line of sight through (u, v), in px from the middle at rest.
float2 place_at(const Scene s, const float u, const float v, const float z)
{
    const float nearer = s.camera_mm > 0.0f ? 1.0f - z / s.camera_mm : 1.0f;
    return (float2)(u * nearer + 0.5f * (float)(s.W - 1), v * nearer + 0.5f * (float)(s.H - 1));
}

int met(const Scene s, const float u, const float v, const float z)
{
    return value_at(s.height, place_at(s, u, v, z), s.H, s.W) >= z;
}

// Images and ground truth as seen by a camera with a pupil and a lens.
__kernel void view(
    __global const float *restrict light,
    __global const float *restrict height,
    __global const float *restrict slope,
    __global const uchar *restrict labels,
    __global const float *restrict extent,
    __global float *restrict light_out,
    __global float *restrict height_out,
    __global float *restrict slope_out,
    __global uchar *restrict labels_out,
    const int K, const int H, const int W,
    const float camera_mm, const float lens_at_corner)
{
    GRID_2(row, column, H, W)
    const Scene scene = {height, H, W, camera_mm};
    const float half_w = 0.5f * (float)(W - 1), half_h = 0.5f * (float)(H - 1);
    const float x = (float)column - half_w, y = (float)row - half_h;
    const float corner = fmax(half_w * half_w + half_h * half_h, 1.0f);
    const float gain = 1.0f + lens_at_corner * ((x * x + y * y) / corner - 0.5f);
    const float u = x * gain, v = y * gain;

    float below = 0.0f;
    if (camera_mm > 0.0f) {
        const float top = extent[0], bottom = extent[1];
        const float far_ = 2.0f * sqrt(corner) * (top - bottom) / camera_mm;
        const int steps = 1 + (int)ceil(far_);
        float above = top;
        below = bottom;
        for (int i = 1; i < steps; ++i) {
            const float z = top - (top - bottom) * ((float)i / (float)steps);
            if (met(scene, u, v, z)) {
                below = z;
                break;
            }
            above = z;
        }
        for (int i = 0; i < BISECTION_STEPS; ++i) {
            const float z = 0.5f * (above + below);
            if (met(scene, u, v, z)) below = z;
            else above = z;
        }
    }
    const float2 at = place_at(scene, u, v, below);
    const int i = row * W + column, size = H * W;
    for (int k = 0; k < K; ++k) light_out[k * size + i] = value_at(light + k * size, at, H, W);
    height_out[i] = value_at(height, at, H, W);
    slope_out[i] = value_at(slope, at, H, W);
    slope_out[size + i] = value_at(slope + size, at, H, W);
    const int nearest_x = (int)clamp(floor(at.x + 0.5f), 0.0f, (float)(W - 1));
    const int nearest_y = (int)clamp(floor(at.y + 0.5f), 0.0f, (float)(H - 1));
    labels_out[i] = labels[nearest_y * W + nearest_x];
}
