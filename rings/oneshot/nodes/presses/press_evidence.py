"""State the presses of a one-shot sensor as what the core's nodes fit films to."""

from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.sheet_presses import sheet_presses
from tactograph.sdk import (
    F4,
    FilmEvidence,
    FoundBalls,
    Light,
    PixelSize,
    Port,
    node,
    robust_deviation,
)
from tactograph.sdk.nodes import flat_presses


@node
def press_evidence(
    image: PressImages,
    flat: Light,
    circle: Circles,
    selection: Annotated[NDArray[np.uint8], Port("B", "flag", high=1)],
    pixel: PixelSize,
    balls: FoundBalls | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)],
) -> FilmEvidence:
    """Return the evidence for `judge_radius`: the used balls, and LEDs of unknown places.

    A reflectance map accepts any radius, because its coefficients have no scale; lights and a
    gel have one.

    Parameters
    ----------
    image, flat : P x K x H x W presses, levelled, and the K x H x W film at rest
    circle, selection : B x 3 in px, and the balls used, as `fit_reflectance_map` returns them
    pixel : mm per px
    balls : as `find_presses` returns them; None: every press has one ball
    radius_mm : the ball's radius
    """
    sheet = flat_presses(sheet_presses(image), flat)
    circle = np.where(selection[:, None] > 0, circle, 0).astype(np.float32)
    of = np.arange(len(circle), dtype=np.int32) if balls is None else balls.of
    radius, every = np.full(len(circle), radius_mm, np.float32), np.ones(len(image), np.uint8)
    leds = np.ones((len(flat), 3), np.float32), np.ones(len(flat), np.float32)
    # The film at rest of such sensors is not lit by points.
    level, noise = np.ones_like(flat), np.array([0, _variance(sheet)], np.float32)
    return FilmEvidence(sheet, level, circle, radius, of, every, *leds, noise, pixel)


def _variance(light: F4) -> float:
    """Variance of a pixel's light, by differences of second order along the rows."""
    return float(robust_deviation(np.diff(light, 2, axis=2))) ** 2 / 6
