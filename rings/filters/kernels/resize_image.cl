#include "common.clh"

// Every pixel of the result from `down` rows and `across` columns, by their shares.
__kernel void resize(
    __global const float *restrict light,
    __global const int *restrict first_row,
    __global const float *restrict row_shares,
    __global const int *restrict first_column,
    __global const float *restrict column_shares,
    __global float *restrict out,
    const int K, const int H, const int W,
    const int h, const int w,
    const int down, const int across)
{
    GRID_3(k, y, x, K, h, w)
    __global const float *from = light + (k * H + first_row[y]) * W + first_column[x];
    float sum = 0.0f;
    for (int j = 0; j < down; ++j) {
        float line = 0.0f;
        for (int i = 0; i < across; ++i) line += from[j * W + i] * column_shares[x * across + i];
        sum += line * row_shares[y * down + j];
    }
    out[(k * h + y) * w + x] = sum;
}
