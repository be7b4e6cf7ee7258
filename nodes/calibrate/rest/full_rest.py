"""Provide the film at rest at the camera's resolution after a calibration on binned images."""

import cv2
import numpy as np

from tactograph.graph import node
from tactograph.nodes import CoarseDark, CoarseLight, Dark, Light
from tactograph.nodes.calibrate.lights.light_samples import is_uniform
from tactograph.nodes.capture.read_flat import Flat


@node
def full_rest(
    flat: Light,
    dark: Dark,
    binned: CoarseLight,
    binned_dark: CoarseDark,
    *,
    as_taken: bool = False,
) -> Flat:
    """Return the flat frame and the dark image at the camera's resolution.

    Parameters
    ----------
    flat, dark : K x H x W and H x W, as taken
    binned, binned_dark
        K x h x w and h x w, from the calibration: with ambient light subtracted, or a model
        if no flat frame was taken.  If the sizes are equal, these are returned.
    as_taken
        Whether to keep the flat frame as taken, minus ambient light, at any size, with details
        that `binned` lacks, such as markers that were filled in.
    """
    if binned.shape == flat.shape and not as_taken:
        return Flat(binned, binned_dark)
    rows, columns = dark.shape
    ambient = np.float32(np.median(binned_dark) - np.median(dark))
    if is_uniform(flat):
        size = (columns, rows)
        model = [cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR) for plane in binned]
        return Flat(np.stack(model), dark + ambient)
    above = flat - ambient
    return Flat(np.maximum(above, np.float32(0), out=above), dark + ambient)
