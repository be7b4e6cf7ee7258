"""Transfer the light of a calibration's tables to another film."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import F4, Film, Labels, Light, Mask, Port, Slope, node
from tactograph.sdk.nodes import film_light

MIN_PREDICTED_LIGHT = 0.05
"""Light predicted for the old film above which the ratio of both films is used."""


class TablePixels(NamedTuple):
    """Pixels of the tables without a pressed object, as an image of one row."""

    light: Light
    slope: Slope
    mask: Mask
    lit: Labels


@node
def carry_tables(
    lut_light: Annotated[F4, Port("N K", "1")],
    lut_slope: Annotated[F4, Port("N 2", "mm/mm")],
    lut_lit: Annotated[NDArray[np.uint8], Port("N", "LED bits", high=255)],
    old: Film,
    new: Film,
) -> TablePixels:
    """Return the tables' pixels with the light that their slopes have on the new film.

    The light of each pixel is multiplied by the ratio of both films' light (`film_light`) for its
    slope in the middle of the film.  So the residual of the old model is kept.

    Parameters
    ----------
    lut_light, lut_slope, lut_lit : N x K, N x 2 and N: the tables of the old calibration
    old, new : the films; if they are equal, the light does not change by a bit

    Returns
    -------
    Light K x 1 x N, slope 2 x 1 x N, a mask of ones and the LEDs that reach each pixel.
    """
    slope = np.ascontiguousarray(lut_slope.T)
    then, now = (_light(film, slope, float(old.contact)) for film in (old, new))
    ratio = np.where(then > MIN_PREDICTED_LIGHT, now / np.maximum(then, MIN_PREDICTED_LIGHT), 1)
    light = np.asarray(lut_light.T * ratio, np.float32)
    return TablePixels(light[:, None], slope[:, None], np.ones_like(lut_lit[None]), lut_lit[None])


def _light(film: Film, slope: F4, height: float) -> F4:
    """The light of slopes, K x N, on film that is as high as touched film, in the middle."""
    apparent = np.full((1, slope.shape[1]), height / (1 - film.camera * height), np.float32)
    return film_light(slope[:, None], apparent, film, 0.0)[:, 0]
