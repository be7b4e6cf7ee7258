"""Say in a few figures how good a calibration is."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node, warn
from tactograph.nodes import F4, Labels, LutSlope, Mask, Metrics, Spread

POOR_RESIDUAL = 0.05
NARROW = 0.5


@node
def rate_calibration(
    residual: Annotated[F4, Port("K", "1")],
    spread: Spread,
    lut_slope: LutSlope,
    mask: Mask,
    lit: Labels,
    goodness: float | None = None,
) -> Metrics:
    """Return the figures that tell a good calibration from a bad one, and warn of a bad one.

    Parameters
    ----------
    residual
        Root mean square of the reflectance fit per LED; the film at rest is 1.
    spread
        Standard deviation of a.I on lit pixels.
    lut_slope
        N x 2, the slopes in the tables.
    mask, lit
        The pixels of known slope, and the LEDs that reach them.
    goodness
        Of the ball that was found, 0 to 1.

    Returns
    -------
    dict
        ``entries``; ``steepest_slope`` that the tables cover in every direction;
        ``residual_percent``, the largest of the LEDs'; ``spread_percent``;
        ``fully_lit_percent`` of the known pixels; ``ball_goodness``.
    """
    count = len(residual)
    steepest = _covered_everywhere(lut_slope)
    worst = int(np.argmax(residual))
    if residual[worst] > POOR_RESIDUAL:
        warn(
            f"LED {worst + 1}'s light departs by {residual[worst]:.1%} from a smooth function "
            "of the slope: check the ball's radius and the pixel size, or give flat=DIR"
        )
    if steepest < NARROW:
        warn(
            f"the tables cover slopes up to {steepest:.2f} only; press deeper, or use a "
            "smaller ball"
        )
    known = mask > 0
    rated = {
        "entries": float(len(lut_slope)),
        "steepest_slope": steepest,
        "residual_percent": float(100 * residual[worst]),
        "spread_percent": 100 * spread,
        "fully_lit_percent": float(100 * (lit[known] == (1 << count) - 1).mean()),
    }
    return rated if goodness is None else {**rated, "ball_goodness": goodness}


def _covered_everywhere(lut_slope: LutSlope, sectors: int = 16) -> float:
    """The slope up to which every one of `sectors` directions holds entries."""
    azimuth = np.arctan2(lut_slope[:, 1], lut_slope[:, 0])
    sector = ((azimuth + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
    steep = np.zeros(sectors)
    np.maximum.at(steep, sector, np.hypot(lut_slope[:, 0], lut_slope[:, 1]))
    return float(steep.min())
