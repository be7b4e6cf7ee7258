#include "common.clh"
#include "lanes.clh"
#include "border.clh"

#define LINES_PER_ITEM (LANES == 1 ? 1 : 15)
#define QUARTER_COUNT 4
#define MIN_AWAY_PX 1e-6f
#define LEAST_OF_NONE 1e30f

// Where a line through a corner of a quarter meets the last row, from the LED's foot.
static float end_of(const float aside, const float away, const float rest)
{
    const float within = clamp(aside, -away, away);
    return within + within / away * rest;
}

// The shadows of LINES_PER_ITEM lines away from an LED's foot, in one of the quarters of the plane around
// it: down, up, right, left.  A row here is one across the lines.
__kernel void cast(
    __global const float *restrict height,
    __global const float *restrict lights,
    __global uchar *restrict dark,
    const int H, const int W, const int K, const int blocks,
    const float pixel)
{
    GRID_1(item, K * QUARTER_COUNT * blocks)
    const int k = item / (QUARTER_COUNT * blocks), quarter = item / blocks % QUARTER_COUNT;
    const int turned = quarter > 1, flipped = quarter & 1, number = item % blocks * LINES_PER_ITEM;
    const int rows = turned ? W : H, columns = turned ? H : W;
    const int down = turned ? 1 : W, right = turned ? W : 1;
    const float middle = 0.5f * (rows - 1), centre = 0.5f * (columns - 1);
    const float led_row = lights[3 * k + !turned] / pixel, foot_row = middle + led_row;
    const float led_column = lights[3 * k + turned] / pixel;
#define ROW(r) (flipped ? rows - 1 - (r) : (r))
#define AWAY(r) ((flipped ? -1.0f : 1.0f) * ((float)ROW(r) - middle - led_row))
#define ASIDE(c) ((float)(c) - centre - led_column)

    int first = 0;
    while (first < rows && AWAY(first) < 0.0f) ++first;
    if (first == rows) return;
    const float near = fmax(AWAY(first), MIN_AWAY_PX), far = fmax(AWAY(rows - 1), MIN_AWAY_PX);
    const float depth = (float)(rows - 1 - first), left_end = ASIDE(0), right_end = ASIDE(columns - 1);
    if (left_end > far || right_end < -far) return;
    const float foot = -left_end;
    const float low = fmin(end_of(left_end, near, depth), end_of(left_end, far, 0.0f));
    const float high = fmax(end_of(right_end, near, depth), end_of(right_end, far, 0.0f));
    const float start = floor(foot + low) - 1.0f;
    if (start + (float)number > ceil(foot + high)) return;

    const float steep = lights[3 * k + 2] / far;
    float towards[LINES_PER_ITEM + 1], at[LINES_PER_ITEM + 1], least[LINES_PER_ITEM + 1];
    for (int l = 0; l <= LINES_PER_ITEM; ++l) {
        towards[l] = (start + (float)(number + l) - foot) / far;
        least[l] = LEAST_OF_NONE;
    }
    for (int n = first; n < rows; ++n) {
        const int r = steep < 0.0f ? rows - 1 + first - n : n;
        const float d = fmax(AWAY(r), MIN_AWAY_PX), rest = (float)(rows - 1 - r);
        const float level = steep * rest, scale = far / d;
        const int row = ROW(r) * down;
        for (int l = 0; l <= LINES_PER_ITEM; ++l)
            at[l] = start + (float)(number + l) - towards[l] * rest;

        const int from = (int)clamp(floor(at[0]), 0.0f, (float)columns);
        const int to = (int)clamp(ceil(at[LINES_PER_ITEM]), -1.0f, (float)(columns - 1));
        for (int c = from; c <= to; ++c) {
            const float aside = ASIDE(c), place = (float)c + aside * (rest / d) - start;
            const float whole = floor(place);
            const int l = (int)whole - number;
            if (l < 0 || l >= LINES_PER_ITEM || fabs(aside) > d || (turned && fabs(aside) == d)) continue;
            const float own = (level - height[row + c * right]) * scale;
            const float before = least[l] + (least[l + 1] - least[l]) * (place - whole);
            dark[k * H * W + row + c * right] = before < own;
        }
        for (int l = 0; l <= LINES_PER_ITEM; ++l) {
            const float x = clamp(at[l], 0.0f, (float)(columns - 1));
            const int one = (int)x, other = min(one + 1, columns - 1);
            const float z = height[row + one * right];
            const float between = z + (height[row + other * right] - z) * (x - (float)one);
            const float risen = (level - between) * scale;
            least[l] = x == at[l] && risen < least[l] ? risen : least[l];
        }
    }
}

// The LEDs whose shadow the image shows at a pixel, or `reach` pixels away along one axis (1: x).
LANED __kernel void spread_labels(
    __global const uchar *restrict image_labels,
    __global uchar *restrict near,
    const int H, const int W, const int reach, const int axis)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    ints labels = 0;
    for (int d = -reach; d <= reach; ++d) {
        const int row = axis ? y : clamp(y + d, 0, H - 1), column = axis ? x + d : x;
        labels |= load_bytes_within_border(image_labels + row * W, column, count, W, REPLICATE);
    }
    store_bytes(labels, near + y * W + x, count);
}

// Labels: shadows that the height casts, film that faces away if `attached`, where the image shows
// one near by.
LANED __kernel void join(
    __global const uchar *restrict dark,
    __global const uchar *restrict near,
    __global const float *restrict height,
    __global const float *restrict lights,
    __global uchar *restrict out,
    const int H, const int W, const int K,
    const float pixel,
    const int attached)
{
    GRID_PARTS_OF_ROWS(y, x, count, H, W)
    const int below = min(y + 1, H - 1), above = max(y - 1, 0);
    __global const float *row = height + y * W;
    const ints no = 0, yes = 1;
    const floats one = 1.0f, two = 2.0f, column = (float)x + LANE_NUMBERS;
    const floats columns = (column == 0.0f | column == (float)(W - 1)) ? one : two;
    const floats z = load_floats(row + x, count);
    const floats rightwards = (load_within_border(row, x + 1, count, W, REPLICATE) -
                               load_within_border(row, x - 1, count, W, REPLICATE)) / columns;
    const floats downwards = (load_floats(height + below * W + x, count) -
                              load_floats(height + above * W + x, count)) / (float)max(below - above, 1);
    ints labels = 0;
    for (int k = 0; k < K; ++k) {
        ints shadow = load_bytes(dark + (k * H + y) * W + x, count);
        const floats across = column - 0.5f * (float)(W - 1) - lights[3 * k] / pixel;
        const float down = (float)y - 0.5f * (float)(H - 1) - lights[3 * k + 1] / pixel;
        const float led_z = lights[3 * k + 2];
        const floats faces = rightwards * across + downwards * down + (led_z - z);
        if (attached) shadow |= (led_z < 0.0f ? faces > 0.0f : faces < 0.0f) ? yes : no;
        labels |= shadow << k;
    }
    if (near) labels &= load_bytes(near + y * W + x, count);
    store_bytes(labels, out + y * W + x, count);
}
