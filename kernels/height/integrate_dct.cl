// Equation D1 of docs/model.md.
#include "common.clh"
#include "lanes.clh"
#include "cosine.clh"

#if LANES == 1
// Divergence of the slopes half-way between neighbours; none across the border.
__kernel void divergence(
    __global const float *restrict slope,
    __global float *restrict out,
    const int H, const int W)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    __global const float *p = slope, *q = slope + H * W;
    const float right = x + 1 < W ? (p[i] + p[i + 1]) * 0.5f : 0.0f;
    const float left = x > 0 ? (p[i - 1] + p[i]) * 0.5f : 0.0f;
    const float below = y + 1 < H ? (q[i] + q[i + W]) * 0.5f : 0.0f;
    const float above = y > 0 ? (q[i - W] + q[i]) * 0.5f : 0.0f;
    out[i] = (right - left) + (below - above);
}

// The Poisson equation in the cosine domain, and from pixels to mm.
__kernel void divide(
    __global float *restrict spectrum,
    __global const float *restrict inverse,
    const int H, const int W,
    const float pixel)
{
    GRID_2(y, x, H, W)
    const int i = y * W + x;
    spectrum[i] = spectrum[i] * inverse[i] * pixel;
}
#else

// Rows become columns, and the last plane the first: the slopes of the transposed image.
__kernel void turn_over(
    __global const float *restrict planes, __global float *restrict turned, const int count,
    const int H, const int W)
{
    GRID_3(k, y, x, count, H, W)
    turned[((count - 1 - k) * W + x) * H + y] = planes[(k * H + y) * W + x];
}

// Twice the same divergence for consecutive pixels of a row: a pixel's own slope cancels, except at
// the border.
static ONCE floats twice_divergence(
    __global const float *slope, const int H, const int W, const int y, const int x,
    const int count)
{
    __global const float *p = slope + y * W, *q = slope + H * W + y * W;
    const floats own = load_floats(q + x, count);
    const floats below = y + 1 < H ? load_floats(q + W + x, count) : -own;
    const floats above = y > 0 ? load_floats(q - W + x, count) : -own;
    if (x > 0 && x + LANES < W)
        return LOAD_LANES(p + x + 1) - LOAD_LANES(p + x - 1) + (below - above);
    float across[LANES];
    for (int l = 0; l < LANES; ++l) {
        const int column = min(x + l, W - 1);
        const float right = column + 1 < W ? p[column + 1] : -p[column];
        const float left = column > 0 ? p[column - 1] : -p[column];
        across[l] = right - left;
    }
    return LOAD_LANES(across) + (below - above);
}

// Rows, of LANES pixels each, as columns: to[c * stride + r].
static ONCE void store_turned(
    const floats *rows, const int height, __global float *to, const int stride, const int count)
{
    float tile[LANES * LANES];
    for (int r = 0; r < height; ++r) STORE_LANES(rows[r], tile + r * LANES);
    for (int c = 0; c < count; ++c)
        for (int r = 0; r < height; ++r) to[c * stride + r] = tile[r * LANES + c];
}

// The cosine transform of the divergence down the columns, W x H: a column is a row now.
LANED __kernel void transform(
    __global const float *restrict slope,
    __global const float2 *restrict turns,
    __global floats *restrict scratch,
    __global float *restrict spectrum,
    const int H, const int W)
{
    const int item = get_global_id(0), x = 2 * LANES * item;
    if (x >= W) return;
    const int first = min(LANES, W - x), second = min(LANES, W - x - LANES);
    __global floats *a = scratch + 4 * H * item, *b = a + 2 * H;
    for (int y = 0; y < H; ++y) {
        __global floats *pair = a + 2 * even_first(y, H);
        pair[0] = twice_divergence(slope, H, W, y, x, first);
        pair[1] = second > 0 ? twice_divergence(slope, H, W, y, x + LANES, second) : pair[0];
    }
    a = fourier(turns, H, a, b);
    for (int v = 0; v < H; v += LANES) {
        const int height = min(LANES, H - v);
        floats rows[LANES], others[LANES];
        for (int r = 0; r < height; ++r) {
            const int k = v + r, mirrored = k ? H - k : 0;
            __global const floats *z = a + 2 * k, *m = a + 2 * mirrored;
            const float2 w = turns[k];
            rows[r] = w.x * (z[0] + m[0]) - w.y * (z[1] - m[1]);
            others[r] = w.x * (z[1] + m[1]) - w.y * (m[0] - z[0]);
        }
        store_turned(rows, height, spectrum + x * H + v, H, first);
        if (second > 0) store_turned(others, height, spectrum + (x + LANES) * H + v, H, second);
    }
}

// Sweep to the right and to the left through the tridiagonal systems of LANES frequencies; the
// sum of what comes out.
static ONCE floats sweep(
    __global float *spectrum, __global const float *pivots, const int H, const int W,
    const int count, const float scale)
{
    floats z = 0.0f, sum = 0.0f;
    for (int i = 0; i < H * W; i += H) {
        z = (z - scale * load_floats(spectrum + i, count)) * load_floats(pivots + i, count);
        store_floats(z, spectrum + i, count);
    }
    z = 0.0f;
    for (int i = H * W - H; i >= 0; i -= H) {
        z = load_floats(spectrum + i, count) + z * load_floats(pivots + i, count);
        store_floats(z, spectrum + i, count);
        sum += z;
    }
    return sum;
}

// The Poisson equation along the rows whose columns are transformed: each frequency v is a
// tridiagonal system -z[x-1] + (2 + c) z[x] - z[x+1] = -spectrum[x], whose pivots' inverses are
// known.  Frequency 0 determines the height up to a constant, and gets a mean of zero.
LANED __kernel void solve(
    __global float *restrict spectrum,
    __global const float *restrict pivots,
    const int H, const int W,
    const float scale)
{
    GRID_LANES(v, count, H)
    __global float *here = spectrum + v;
    const floats sum = count == LANES ? sweep(here, pivots + v, H, W, LANES, scale)
                                      : sweep(here, pivots + v, H, W, count, scale);
    if (v > 0) return;
    float sums[LANES];
    STORE_LANES(sum, sums);
    const float mean = sums[0] / (float)W;
    for (int x = 0; x < W; ++x) spectrum[x * H] -= mean;
}

// Columns as rows of LANES pixels: from[c * stride + r].
static ONCE void load_turned(
    __global const float *from, const int stride, const int count, const int height, floats *rows)
{
    float tile[LANES * LANES];
    for (int c = 0; c < LANES; ++c)
        for (int r = 0; r < height; ++r)
            tile[r * LANES + c] = from[min(c, count - 1) * stride + r];
    for (int r = 0; r < height; ++r) rows[r] = LOAD_LANES(tile + r * LANES);
}

// And back from the frequencies, W x H, to the heights.
LANED __kernel void transform_back(
    __global const float *restrict spectrum,
    __global const float2 *restrict turns,
    __global floats *restrict scratch,
    __global float *restrict out,
    const int H, const int W)
{
    const int item = get_global_id(0), x = 2 * LANES * item;
    if (x >= W) return;
    const int first = min(LANES, W - x), second = min(LANES, W - x - LANES);
    __global floats *a = scratch + 4 * H * item, *b = a + 2 * H;
    for (int v = 0; v < H; v += LANES) {
        const int height = min(LANES, H - v);
        floats rows[LANES], others[LANES];
        load_turned(spectrum + x * H + v, H, first, height, rows);
        if (second > 0) load_turned(spectrum + (x + LANES) * H + v, H, second, height, others);
        for (int r = 0; r < height; ++r) {
            b[2 * (v + r)] = rows[r];
            b[2 * (v + r) + 1] = second > 0 ? others[r] : rows[r];
        }
    }
    // With real and imaginary parts swapped, the transform is the inverse.
    const floats none = 0.0f;
    for (int k = 0; k < H; ++k) {
        const float2 w = turns[k];
        __global const floats *z = b + 2 * k, *m = b + 2 * (H - k);
        const floats m0 = k ? m[0] : none, m1 = k ? m[1] : none;
        const floats re = z[0] + m1, im = z[1] - m0;
        a[2 * k] = w.x * im - w.y * re;
        a[2 * k + 1] = w.x * re + w.y * im;
    }
    a = fourier(turns, H, a, b);
    const float scale = 1.0f / (float)H;
    for (int y = 0; y < H; ++y) {
        __global const floats *pair = a + 2 * even_first(y, H);
        store_floats(pair[1] * scale, out + y * W + x, first);
        if (second > 0) store_floats(pair[0] * scale, out + y * W + x + LANES, second);
    }
}
#endif
