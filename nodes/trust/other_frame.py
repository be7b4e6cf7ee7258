"""Find images in another order or orientation than the flat frame's.

Beside a touch the film is at rest, and its light falls off as in the flat frame, in a different
direction under each LED.  Images that are exchanged show another LED's fall-off; mirrored or turned
images fall off in another direction.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, F8
from tactograph.nodes.trust.checked_cells import MIN_CELLS, MIN_LIGHT
from tactograph.nodes.trust.explained import explains
from tactograph.nodes.trust.fall_off import RING_CELLS, border_cells

TURNED_IMAGES: dict[str, Callable[[F4], F4]] = {
    "mirrored left to right": lambda planes: planes[..., ::-1],
    "mirrored top to bottom": lambda planes: planes[..., ::-1, :],
    "turned by half": lambda planes: planes[..., ::-1, ::-1],
}
"""The map that undoes each orientation of the camera or its images."""


def other_frame(touch: F4, flat: F4, free: NDArray[np.bool_]) -> str:
    """Return what was done to the images of a touch, in words; "" if nothing explains it.

    If LEDs stand symmetrically to an axis, mirrored images look like exchanged LEDs; both are
    named.

    Parameters
    ----------
    touch, flat : K x h x w, the light of the touch and of the film at rest, on cells
    free : h x w, film at rest in the touch
    """
    touched, due = (np.log(np.maximum(a, MIN_LIGHT)) for a in (touch, flat))
    apart = _difference(touched, due, free)
    as_it_is = float(np.trace(apart)) / len(apart)
    if np.count_nonzero(free) < MIN_CELLS or not explains(0.0, as_it_is):
        return ""
    residuals = {}
    for side, turn in TURNED_IMAGES.items():
        turned = turn(free[None].astype(np.float32))[0] > 0
        residuals[side] = float(np.trace(_difference(turn(touched), due, turned))) / len(apart)
    from scipy.optimize import linear_sum_assignment  # takes 0.2 s; most touches end above

    image, led = linear_sum_assignment(apart)
    if (image != led).any():
        order = ", ".join(str(k + 1) for k in np.argsort(led))
        residuals[f"in another order (taken as {order} they fit)"] = float(apart[image, led].mean())
    return ", or ".join(words for words, each in residuals.items() if explains(each, as_it_is))


def other_colours(touch: F4, flat: F4) -> str:
    """Return what was done to a one-shot sensor's colours or image, in words; "" if nothing.

    Parameters
    ----------
    touch, flat : K x h x w, the light of the touch and of the film at rest, on cells
    """
    other = other_frame(touch, flat, border_cells(flat.shape[1:], RING_CELLS))
    if not other:
        return ""
    colours = " (are the colours RGB where BGR is meant?)" if "order" in other else ""
    return f"along the border the image shows the film of the flat frame {other}{colours}"


def _difference(touched: F4, due: F4, free: NDArray[np.bool_]) -> F8:
    """The mean squared difference of each image's fall-off (rows) from each LED's (columns)."""
    images, leds = (a[:, free].astype(np.float64) for a in (touched, due))
    between = images[:, None] - leds[None]
    return np.asarray(between.var(axis=2))
