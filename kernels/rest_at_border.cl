#include "common.clh"
#include "float_keys.clh"

#define GROUP 64

// The lower median of the border by bisection on the bits; one work-group.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void border_median(
    __global const float *restrict height,
    __global float *restrict median,
    const int H, const int W,
    const int border)
{
    __local int counts[GROUP];
    __local uint low, high;
    const int me = get_local_id(0);
    const int inner = max(H - 2 * border, 0) * max(W - 2 * border, 0);
    const int middle = (H * W - inner - 1) / 2;
    if (me == 0) {
        low = 0u;
        high = 0xffffffffu;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int bit = 0; bit < 32; ++bit) {
        const uint pivot = low + (high - low) / 2;
        int below = 0;
        for (int y = 0; y < H; ++y) {
            const int edge = y < border || y >= H - border;
            // Rows of the top and bottom count whole, the others by their two ends.
            const int span = edge ? W : min(2 * border, W);
            for (int j = me; j < span; j += GROUP) {
                const int x = edge || j < border ? j : W - 2 * border + j;
                below += key_of(height[y * W + x]) <= pivot;
            }
        }
        counts[me] = below;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (me == 0) {
            int total = 0;
            for (int i = 0; i < GROUP; ++i) total += counts[i];
            if (total > middle) high = pivot;
            else low = pivot + 1;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (me == 0) median[0] = value_of(low);
}

__kernel void subtract(
    __global const float *restrict height,
    __global const float *restrict median,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    out[y * W + x] = height[y * W + x] - median[0];
}
