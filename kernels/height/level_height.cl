#include "common.clh"
#include "lanes.clh"
#include "near_light.clh"

// The height in the middle of every cell.
__kernel void sample_cells(
    __global const float *restrict height,
    __global float *restrict sampled,
    const int H, const int W, const int rows, const int columns, const int cell)
{
    GRID_2(y, x, rows, columns)
    const int row = min(y * cell + cell / 2, H - 1), column = min(x * cell + cell / 2, W - 1);
    sampled[y * columns + x] = height[row * W + column];
}

// The height minus a surface of degree 3 in u and v.
LANED __kernel void take_off(
    __global const float *restrict height,
    __global float *restrict out,
    const int H, const int W,
    const float c, const float cu, const float cv, const float cuu, const float cuv,
    const float cvv, const float cuuu, const float cuuv, const float cuvv, const float cvvv)
{
    GRID_LANES(at, count, H * W)
    floats u, v;
    places(at, H, W, 2.0f / (float)W, &u, &v);
    const floats smooth = c + u * (cu + u * (cuu + u * cuuu)) + v * (cv + v * (cvv + v * cvvv)) +
                          u * v * (cuv + u * cuuv + v * cuvv);
    store_floats(load_floats(height + at, count) - smooth, out + at, count);
}
