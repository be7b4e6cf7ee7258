"""Undistort the presses of a one-shot sensor, its film at rest, and known circles."""

from typing import NamedTuple

import numpy as np

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.sdk import Lens, Light, StatedCircles, View, node
from tactograph.sdk.nodes import undistort


class EvenPresses(NamedTuple):
    """Presses and film at rest on the ideal grid, and known contacts."""

    image: PressImages
    flat: Light
    circle: StatedCircles


@node
def even_presses(image: PressImages, flat: Light, circle: StatedCircles, lens: Lens) -> EvenPresses:
    """Return the presses of `read_presses` as a camera without distortion would see them.

    Parameters
    ----------
    image, flat : P x K x H x W presses and the K x H x W film at rest, as captured
    circle : P x 3 in px of the captured images; the radius does not change
    lens : length 8 as `read_lens` gives it, all zero for an ideal lens
    """
    view = View(lens)
    if view.is_plain:
        return EvenPresses(image, flat, circle)
    presses = np.stack([undistort(press, lens) for press in image])
    circle = view.ideal_circles(flat.shape[1:], circle)
    return EvenPresses(presses, undistort(flat, lens), circle)
