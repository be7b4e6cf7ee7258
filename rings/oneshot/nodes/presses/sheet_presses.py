"""Put presses one below another on a sheet, as nodes for flashed sensors take them."""

import numpy as np

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.sdk import SheetLight, node


@node
def sheet_presses(image: PressImages) -> SheetLight:
    """Return P x K x H x W presses as K x S x W.

    Parameters
    ----------
    image : P x K x H x W
    """
    return np.concatenate(list(image), axis=1)
