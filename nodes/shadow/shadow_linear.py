"""The paper's shadow test: are the intensities of a pixel linearly dependent?"""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, SizeLimit, node
from tactograph.nodes import Labels, Light, NullVector, Spread
from tactograph.nodes.optics.cache_blocks import in_blocks


@node(
    neutral=0,
    tolerance=Close(share=1e-4, why="a threshold on a float32 sum"),
    sizes={
        "K": SizeLimit(
            4,
            8,
            "the shadow test needs 4 to 8 LEDs, since three light directions are linearly "
            "independent; with three use paper_no_shadow, or reconstruct and precise, which "
            "find shadows of three LEDs by the length of the normal",
        )
    },
)
def shadow_linear(
    light: Light,
    null: NullVector,
    spread: Spread,
    *,
    threshold: Annotated[float, Gt(0)] = 3.0,
) -> Labels:
    """Label the darkest LED where a.I departs from zero (section 3.2, equations 10 and 11).

    Where all LEDs light the surface, a.I = 0 up to noise.  Where |a.I| exceeds lambda =
    threshold * spread, one intensity is inconsistent with the others; the paper takes it to be the
    darkest one.  Two neighbouring LEDs that are shadowed at once cancel in a.I and are missed.

    Parameters
    ----------
    light : K x H x W
    null : K, the vector a, of unit length
    spread : standard deviation of a.I on lit pixels
    threshold : lambda in multiples of `spread`

    Returns
    -------
    H x W, bit k-1 set where LED k is shadowed.
    """
    lights, level = light.reshape(len(light), -1), np.float32(threshold) * np.float32(spread)
    labels = np.empty(lights.shape[1], np.uint8)

    def label(part: slice) -> None:
        darkest, least = labels[part], lights[0, part]
        departure = np.zeros_like(least)
        darkest[:] = 1
        for k, (a, plane) in enumerate(zip(null, lights[:, part], strict=True)):
            departure += a * plane
            np.copyto(darkest, np.uint8(1 << k), where=plane < least)
            least = np.minimum(plane, least)
        darkest *= np.abs(departure) > level

    in_blocks(label, len(labels))
    return labels.reshape(light.shape[1:])


shadow_linear.opencl(grid="H W", lanes="grid")
