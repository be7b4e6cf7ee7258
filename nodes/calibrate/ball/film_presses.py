"""Presses in which pixels that show no film look like film at rest."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Dark, Light, Mask
from tactograph.nodes.light.within_film import within_film
from tactograph.nodes.optics.sheet import SheetLight, cut


@node(neutral="image")
def film_presses(image: SheetLight, area: Mask, flat: Light, dark: Dark) -> SheetLight:
    """Return every press on a sheet as `within_film` does.

    Parameters
    ----------
    image : K x S x W, a sheet of captures
    area : H x W, 1 where the frame shows film
    flat, dark : K x H x W and H x W
    """
    presses = cut(image, flat.shape[1])
    return np.concatenate([within_film(press, area, flat, dark) for press in presses], axis=1)
