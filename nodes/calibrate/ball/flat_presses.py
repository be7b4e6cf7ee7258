"""Divide every press on a sheet by the untouched film."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Dark, Light
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.optics.sheet import SheetLight, cut


@node(neutral="image")
def flat_presses(image: SheetLight, flat: Light, dark: Dark | None = None) -> SheetLight:
    """Return the light of every press relative to the film at rest, as `flat_field` does.

    Parameters
    ----------
    image : K x S x W, a sheet of captures
    flat, dark : K x H x W and H x W; None: black
    """
    if dark is None:
        dark = np.zeros(flat.shape[1:], np.float32)
    rows = flat.shape[1]
    return np.concatenate([flat_field(press, flat, dark) for press in cut(image, rows)], axis=1)
