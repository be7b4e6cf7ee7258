// Equation W1 of docs/model.md.
#include "common.clh"

#define USUAL_MISFIT 12.0f

// The variance of the slopes, increased by misfit and by an open choice between two normals.
__kernel void misfit_variance(
    __global const float *restrict variance, __global const float *restrict slope,
    __global const float *restrict twin, __global const float *restrict misfit,
    __global float *restrict out, const int H, const int W, const int open_pairs,
    const float steepest)
{
    GRID_2(y, x, H, W)
    const int size = H * W, i = y * W + x;
    const float p = slope[i], q = slope[size + i];
    const float twin_p = twin[i], twin_q = twin[size + i];
    const float wider = fmax(misfit[i] / USUAL_MISFIT, 1.0f);
    const int doubt = open_pairs && p * p + q * q > 0.002f && (twin_p != p || twin_q != q);
    const float apart_p = doubt ? clamp(twin_p, -steepest, steepest) - p : 0.0f;
    const float apart_q = doubt ? clamp(twin_q, -steepest, steepest) - q : 0.0f;
    out[i] = variance[i] * wider + 0.25f * apart_p * apart_p;
    out[size + i] = variance[size + i] * wider + 0.25f * apart_q * apart_q;
}
