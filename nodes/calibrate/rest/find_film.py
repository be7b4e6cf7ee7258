"""Distinguish film in a frame from a housing and from dark parts."""

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Port, node, warn
from tactograph.nodes import F4, U1, Light, Mask
from tactograph.nodes.optics.smoothed_light import FILM_PERCENTILE, MAX_DARK_SHARE, MAX_FIT_PIXELS

RIM_LIGHT_SHARE = 0.5
"""Light relative to nearby film below which a pixel is the blurred rim of a dark part."""
MIN_PART_SHARE, MIN_RIM_SHARE = 0.005, 0.05
"""Shares of the frame and of its border above which a dark part is no marker."""
MARGIN_PX = 5
"""Width of film beside a dark part that is excluded, since the flat frame is smoothed."""
MAX_CONTINUED_RATIO = 1.5
"""Upper bound on continued light, as a multiple of the light on the film."""


class FilmArea(NamedTuple):
    """The film at rest, continued over the whole frame, and where the frame shows it."""

    flat: Light
    area: Mask


@node
def find_film(
    flat: Light,
    visible: Annotated[U1, Port("R C", "flag", high=1)] | None = None,
    *,
    dark: Annotated[float, Interval(ge=0, lt=1)] = MAX_DARK_SHARE,
    warning: bool = False,
) -> FilmArea:
    """Return where a frame shows film, and its light continued over the rest of the frame.

    Round views, housings and black frames leave parts of the flat frame without light.  Such a
    part is dark under all LEDs and reaches the border of the frame.  There the flat frame is
    continued by a polynomial of degree 2 in x and y, fitted to the logarithm of the light that
    each LED gives the film.

    Parameters
    ----------
    flat : K x H x W, dark level subtracted
    visible
        R x C, as fine as the flat frame or finer: 0 where the film hides itself; None: nowhere
    dark : largest light of a dark pixel, as a share of the film's
    warning : whether to warn of parts without film
    """
    area = _area(flat, dark)
    if visible is not None:
        rows, columns = area.shape
        side = visible.shape[0] // rows
        whole = visible[: rows * side, : columns * side].reshape(rows, side, columns, side)
        area &= whole.min(axis=(1, 3))
    if area.all():
        return FilmArea(flat, area)
    if warning:
        warn(
            f"the film fills {area.mean():.0%} of the frame: pixels without light are left out "
            "(a crop to the film would keep the images small)"
        )
    continued = flat.copy()
    for plane in continued:
        plane[area == 0] = _continued(plane, area)
    return FilmArea(continued, area)


def _area(flat: Light, dark: float) -> U1:
    """1 where the frame shows film."""
    brightest = flat.max(axis=0)
    side = 2 * MARGIN_PX + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    missing = brightest < dark * np.percentile(brightest, FILM_PERCENTILE)
    missing |= brightest < RIM_LIGHT_SHARE * cv2.dilate(brightest, disc)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(missing.astype(np.uint8), connectivity=4)
    ring = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    large = [
        part
        for part in np.unique(ring)
        if part
        and stats[part, cv2.CC_STAT_AREA] >= MIN_PART_SHARE * missing.size
        and np.count_nonzero(ring == part) >= MIN_RIM_SHARE * ring.size
    ]
    if not large:
        return np.ones(missing.shape, np.uint8)
    return np.asarray(1 - cv2.dilate(np.isin(parts, large).astype(np.uint8), disc), np.uint8)


def _continued(plane: F4, area: U1) -> F4:
    """The light of an LED, continued from the film over the rest of the frame."""
    inside = np.flatnonzero(area)
    inside = inside[:: 1 + inside.size // MAX_FIT_PIXELS]
    light = plane.ravel()[inside]
    low, high = np.percentile(light, [1, 99])
    logs = np.log(np.clip(light, max(low, 1e-4), None))
    coefficients = np.linalg.lstsq(_terms(inside, area.shape).T, logs, rcond=None)[0]
    logs = coefficients @ _terms(np.flatnonzero(area == 0), area.shape)
    light = np.exp(
        np.clip(logs, *np.log([max(low, 1e-4) / MAX_CONTINUED_RATIO, high * MAX_CONTINUED_RATIO]))
    )
    return np.asarray(light, np.float32)


def _terms(places: NDArray[np.intp], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The polynomial's terms at places of the frame, counted row by row."""
    y, x = (each / max(shape) - 0.5 for each in np.unravel_index(places, shape))
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
