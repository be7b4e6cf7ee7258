#include "common.clh"

// The light of a film with a grid of markers on it, dragged sideways about a centre.
__kernel void print_markers(
    __global const float *restrict light,
    const float pixel,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float pitch_mm, const float radius_mm, const float dash_mm, const float contrast,
    const float drag_x_mm, const float drag_y_mm,
    const float center_x_mm, const float center_y_mm, const float reach_mm)
{
    GRID_3(k, row, column, K, H, W)
    const float x = ((float)column - 0.5f * (float)(W - 1)) * pixel;
    const float y = ((float)row - 0.5f * (float)(H - 1)) * pixel;
    const float dx = x - center_x_mm, dy = y - center_y_mm;
    const float near = exp(-(dx * dx + dy * dy) / (2.0f * reach_mm * reach_mm));
    float u = x - drag_x_mm * near, v = y - drag_y_mm * near;
    u = u - pitch_mm * rint(u / pitch_mm);
    v = v - pitch_mm * rint(v / pitch_mm);
    u = fmax(fabs(u) - 0.5f * dash_mm, 0.0f);
    const float away = sqrt(u * u + v * v);
    const float covered = clamp((radius_mm - away) / pixel + 0.5f, 0.0f, 1.0f);
    const int i = (k * H + row) * W + column;
    out[i] = light[i] * (1.0f - contrast * covered);
}
