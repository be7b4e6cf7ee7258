#include "common.clh"

// Rises less those of the film at rest.
__kernel void rises_from_rest(
    __global const int *restrict rises_top, __global const int *restrict rises_foot,
    __global const float *restrict rises_rise, __global const uchar *restrict rises_led,
    __global const float *restrict rest,
    __global int *restrict top, __global int *restrict foot,
    __global float *restrict rise, __global uchar *restrict led,
    const int C, const int H, const int W)
{
    const int i = get_global_id(0);
    if (i >= C) return;
    top[i] = rises_top[i];
    foot[i] = rises_foot[i];
    led[i] = rises_led[i];
    rise[i] = rest ? rises_rise[i] - (rest[rises_top[i]] - rest[rises_foot[i]]) : rises_rise[i];
}
