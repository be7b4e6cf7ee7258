"""The response of a sensor along z: amplification, linearity and what is left of known shapes."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.metrology.nodes.certify.compare_shapes import Compared
from tactograph.sdk import F8, Port, node

LEVEL_COUNT = 10
"""Levels of the response curve, of equally many points each."""


class Response(NamedTuple):
    """Figures, and the curve: true height, mean deviation and its spread of every level."""

    metrics: dict[str, float]
    curve: Annotated[F8, Port("3 B", "mm")] | None = None


class Parts(NamedTuple):
    """What the points of known shapes say of a response, in mm and 1."""

    amplification: float
    shapes: F8
    """The amplification by every shape alone."""
    of: NDArray[np.intp]
    """The shape of every point, counted from 0."""
    curve: F8
    linearity: float
    residual: F8
    """What amplification and offset of its own leave of every point."""


@node
def response_curve(compared: Compared) -> Response:
    """Fit found to true heights, and split what is left by touches and by shapes.

    ISO 25178-600: the amplification coefficient is the slope of the line fitted to the response
    curve, the linearity deviation the largest distance of the curve from it.  Topography fidelity
    is the root mean square of found less true height.  A shape's own amplification varies over
    the field, and beyond that from touch to touch, which is reproducibility: variance components
    of one random factor (ISO 5725-2).

    Parameters
    ----------
    compared : as `compare_shapes` gives it

    Returns
    -------
    Response
        ``amplification_coefficient`` and its standard deviation over shapes
        ``amplification_spread``; ``linearity_deviation_um``; ``topography_fidelity_um``;
        ``height_range_um``, over which these hold; ``known_shapes``, ``known_touches``;
        of two touches or more ``reproducibility_percent`` of a height.
    """
    true, measured, _, shape, touch = compared
    if not len(true):
        return Response({})
    parts = response_parts(true, measured, shape)
    figures: dict[str, float] = {
        "amplification_coefficient": parts.amplification,
        "linearity_deviation_um": 1e3 * parts.linearity,
        "topography_fidelity_um": 1e3 * float(np.sqrt(np.mean(np.square(measured - true)))),
        "height_range_um": 1e3 * float(np.ptp(true)),
        "known_shapes": float(len(parts.shapes)),
        "known_touches": float(len(np.unique(touch))),
    }
    if len(parts.shapes) > 1:
        figures["amplification_spread"] = float(parts.shapes.std(ddof=1))
    if figures["known_touches"] > 1:
        touches = touch[np.unique(shape, return_index=True)[1]]
        figures["reproducibility_percent"] = 100 * _between(parts.shapes, touches) ** 0.5
    return Response(figures, parts.curve)


def response_parts(true: F8, measured: F8, shape: NDArray[np.int32]) -> Parts:
    """Amplification, linearity and residuals of points; shapes need not be numbered from 0."""
    _, of = np.unique(shape, return_inverse=True)
    apart = measured - true
    amplification = float(true @ measured / (true @ true))
    by_shape = np.bincount(of, true * measured) / np.bincount(of, true * true)
    edges = np.quantile(true, np.linspace(0, 1, LEVEL_COUNT + 1))
    level = np.clip(np.searchsorted(edges, true, side="right") - 1, 0, LEVEL_COUNT - 1)
    count = np.maximum(np.bincount(level, minlength=LEVEL_COUNT), 1)
    middle, mean = (np.bincount(level, each, LEVEL_COUNT) / count for each in (true, apart))
    spread = np.sqrt(np.bincount(level, np.square(apart - mean[level]), LEVEL_COUNT) / count)
    line = np.polynomial.Polynomial.fit(middle, mean, 1)
    linearity = float(np.abs(mean - line(middle)).max())
    residual = measured - by_shape[of] * true
    curve = np.stack([middle, mean, spread])
    return Parts(amplification, by_shape, of, curve, linearity, residual)


def _between(values: F8, group: NDArray[np.int32]) -> float:
    """The variance between groups, beyond that within them."""
    _, of = np.unique(group, return_inverse=True)
    count = np.bincount(of)
    groups, free = len(count), len(values) - len(count)
    mean = np.bincount(of, values) / count
    within = float(np.square(values - mean[of]).sum() / free) if free else 0.0
    among = float(count @ np.square(mean - values.mean()) / (groups - 1))
    usual = (len(values) - (count @ count) / len(values)) / (groups - 1)
    return max(among - within, 0.0) / float(usual)
