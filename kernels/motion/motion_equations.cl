#include "common.clh"

#define CAUCHY_SIGMAS 2.4f
#define AT_GRADIENT 21
#define AT_PAIRS 27
#define AT_ACROSS 30
#define AT_DOWN 33
#define SUMS 36

// The Jacobian's six numbers at a cell, equation R1.
static void jacobian_at(
    __global const float *height, __global const float *steepness, const int W, const int size,
    __global const float *terms, const int row, const int column, float *out)
{
    const int at = row * W + column;
    const float x = terms[1] + terms[0] * (float)column, y = terms[2] + terms[0] * (float)row;
    const float a = steepness[at], b = steepness[size + at], c = terms[3], z = height[at];
    out[0] = a;
    out[1] = b;
    out[2] = c;
    out[3] = y * c - z * b;
    out[4] = z * a - x * c;
    out[5] = x * b - y * a;
}

static void add(float *sums, const float weight, const float *jacobian, const float target)
{
    int row = 0;
    for (int i = 0; i < 6; ++i) {
        const float weighted = weight * jacobian[i];
        for (int j = i; j < 6; ++j) sums[row++] += weighted * jacobian[j];
        sums[AT_GRADIENT + i] += weighted * target;
    }
}

// A block of cells: each with its neighbours right and below.
__kernel void motion_equations(
    __global const float *restrict height,
    __global const float *restrict steepness,
    __global const float *restrict residual,
    __global const uchar *restrict seen,
    __global const float *restrict terms,
    __global float *restrict out,
    const int H, const int W, const int h, const int w,
    const int block)
{
    GRID_2(block_row, block_column, h, w)
    const float side = terms[0], level = terms[4], weight_of_height = terms[5];
    const int last_row = min((block_row + 1) * block, H);
    const int last_column = min((block_column + 1) * block, W);
    float sums[SUMS];
    for (int i = 0; i < SUMS; ++i) sums[i] = 0.0f;
    for (int row = block_row * block; row < last_row; ++row) {
        for (int column = block_column * block; column < last_column; ++column) {
            const int at = row * W + column;
            if (!seen[at]) continue;
            float here[6], there[6];
            jacobian_at(height, steepness, W, H * W, terms, row, column, here);
            add(sums, weight_of_height, here, residual[at]);
            for (int down = 0; down < 2; ++down) {
                const int next = down ? at + W : at + 1;
                if ((down ? row + 1 >= H : column + 1 >= W) || !seen[next]) continue;
                jacobian_at(height, steepness, W, H * W, terms, row + down, column + 1 - down, there);
                for (int i = 0; i < 6; ++i) there[i] = (there[i] - here[i]) / side;
                const float slope = (residual[next] - residual[at]) / side;
                const float rise = (height[next] - height[at]) / side;
                const float far = slope / (CAUCHY_SIGMAS * level);
                const float weight = 1.0f / (1.0f + far * far);
                add(sums, weight, there, slope);
                const int own = down ? AT_DOWN : AT_ACROSS;
                sums[AT_PAIRS] += weight;
                sums[AT_PAIRS + 1] += weight * slope * slope;
                sums[AT_PAIRS + 2] += slope * slope;
                sums[own] += 1.0f;
                sums[own + 1] += rise;
                sums[own + 2] += rise * rise;
            }
        }
    }
    for (int i = 0; i < SUMS; ++i) out[(block_row * w + block_column) * SUMS + i] = sums[i];
}
