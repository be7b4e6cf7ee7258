__kernel void leaned(
    __global const float *restrict image, __global const float *restrict table,
    __global float *restrict out, const int K, const int H, const int W, const int M)
{
    const int x = get_global_id(0), y = get_global_id(1), k = get_global_id(2);
    if (x >= W || y >= H)
        return;
    const int i = (k * H + y) * W + x;
    out[i] = image[i];
    for (int j = 0; j < M; ++j)
        out[i] += table[j];
}
