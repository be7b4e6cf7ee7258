"""Read presses of objects of any shape, from which a sensor is calibrated."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactograph.sdk import Layout, Light, SheetLight, StatedCircles, node


class ObjectPresses(NamedTuple):
    """P presses as a sheet, the first of them alone, and the circles of balls: none is known."""

    image: SheetLight
    first: Light
    circles: StatedCircles


@node
def read_objects(*, folder: Path, flat: Path, layout: Layout) -> ObjectPresses:
    """Read a press of an object, or a folder of them.

    Parameters
    ----------
    folder : a capture, or a folder of captures, which are read in order of name
    flat : the capture of the untouched film, which must be another

    Returns
    -------
    Images K x S x W on a sheet (`sheet`), the first press K x H x W, and P x 3 NaN.

    Raises
    ------
    InputError
        As `read_capture`; if `flat` is `folder`; if presses differ in size.
    """
    images = [capture.image for capture in layout.presses(folder, flat)]
    unknown = np.full((len(images), 3), np.nan, np.float32)
    return ObjectPresses(np.concatenate(images, axis=1), images[0], unknown)
