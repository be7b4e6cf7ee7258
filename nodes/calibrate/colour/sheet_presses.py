"""Put presses one below another on a sheet, as nodes for flashed sensors take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes.calibrate import BallPress
from tactograph.nodes.capture.read_presses import PressImages
from tactograph.nodes.optics.sheet import SheetLight


class Sheet(NamedTuple):
    """Presses on a sheet (`sheet`), and the press that each of their balls is in."""

    image: SheetLight
    of: BallPress


@node
def sheet_presses(image: PressImages) -> Sheet:
    """Return P x K x H x W presses as K x S x W, each with one ball.

    Parameters
    ----------
    image
        P x K x H x W.
    """
    return Sheet(np.concatenate(list(image), axis=1), np.arange(len(image), dtype=np.int32))
