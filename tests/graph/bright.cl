#include "common.clh"

__kernel void bright(
    __global const float *restrict image,
    __global int *restrict pixel,
    __global float *restrict light,
    const float above, const int size)
{
    GRID_1(one, 1)
    int count = 0;
    for (int i = 0; i < size; ++i)
        if (image[i] > above) {
            pixel[count] = i;
            light[count++] = image[i];
        }
}
