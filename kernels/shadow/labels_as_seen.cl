#include "common.clh"
#include "lanes.clh"
#include "lens.clh"

// The labels that each pixel of the camera sees: those of the nearest ideal pixel.
LANED __kernel void labels_as_seen(
    __global const uchar *restrict labels,
    __global const float *restrict lens,
    __global uchar *restrict out,
    const int H, const int W)
{
    GRID_PARTS_OF_ROWS(row, column, count, H, W)
    const int at = row * W + column;
    ints seen;
    if (is_bent(lens)) {
        floats u, v;
        ideal_places(lens, row, column, H, W, &u, &v);
        const floats none = 0.0f, right = (float)(W - 1), bottom = (float)(H - 1);
        int from[LANES];
        STORE_LANES(TO_INTS(LESS_OF(MORE_OF(v, none), bottom) + 0.5f) * W
                        + TO_INTS(LESS_OF(MORE_OF(u, none), right) + 0.5f), from);
        uchar found[LANES];
        for (int l = 0; l < LANES; ++l) found[l] = labels[from[l]];
        seen = TO_INTS(LOAD_LANES(found));
    } else {
        seen = load_bytes(labels + at, count);
    }
    store_bytes(seen, out + at, count);
}
