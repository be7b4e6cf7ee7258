"""Read the presses of one or several balls from which a sensor is calibrated."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import F4, Light, PixelSize
from tactograph.nodes.capture.listed_capture import ListedCapture, listed_capture
from tactograph.nodes.capture.read_capture import CaptureFile, Layout
from tactograph.nodes.optics.sheet import SheetLight

MAX_MARK_DIFFERENCE = 0.1
"""Share by which a mark may be larger or smaller than its ball."""
Millimetres = Annotated[float, Gt(0)]
Radii = Annotated[F4, Port("P", "mm", low=1, high=3)]
"""The radius of each press's ball."""
StatedCircles = Annotated[F4, Port("P 3", "px", nan=True)]
"""x, y and contact radius of each press's ball; NaN where unknown."""


Marks = Annotated[F4, Port("M 3", "px")]
"""Balls that were marked by hand: x, y and the number of their press."""


class BallPresses(NamedTuple):
    """P presses as a sheet, the first of them alone, and known properties of their balls."""

    image: SheetLight
    first: Light
    radius: Radii
    circles: StatedCircles
    names: list[str]
    marks: Marks | None = None
    pixel_size: PixelSize | None = None


@node
def read_balls(
    *,
    folder: Path,
    flat: Path | None = None,
    radius_mm: Millimetres | tuple[Millimetres, ...] | None = None,
    center_px: tuple[float, float] | None = None,
    contact_px: Millimetres | None = None,
    layout: Layout,
) -> BallPresses:
    """Read one press of a ball, or of a grid of balls, or a folder of them.

    Entries for the ball in a press's ``capture.yaml`` (``ball_radius_mm``,
    ``ball_center_px: [x, y]``, ``ball_contact_px``) take precedence over the parameters.  A scan
    brings the balls that were marked in it, their radius unless it is given, and its pixel size.

    Parameters
    ----------
    folder : a capture, or a folder of captures, which are read in order of name
    flat : the capture of the untouched film, which must be another
    radius_mm : the ball's radius: one for all presses, or one per press in their order
    center_px, contact_px
        x, y of the ball's centre and radius of its contact; only for a single press.

    Returns
    -------
    Images K x S x W on a sheet (`sheet`), the first press K x H x W, radii of length P in mm, known
    circles P x 3 in px, the names of the P folders, marked balls M x 3 in px if there are any, and
    the pixel size that the first scan states.

    Raises
    ------
    InputError
        As `read_capture`; if `flat` is `folder`; if presses differ in size; if a ball's radius is
        not given, or the number of radii does not match the number of presses.
    """
    captures = layout.presses(folder, flat)
    first = captures[0].image
    names = [capture.name for capture in captures]
    if len(names) > 1 and (center_px is not None or contact_px is not None):
        raise InputError(
            f"{folder}: holds {len(names)} presses, and `center_px` and `contact_px` are for "
            "one; write them into each press's capture.yaml"
        )
    files = [CaptureFile.read(folder / name) for name in names]
    scans = [listed_capture(folder / name) or ListedCapture([]) for name in names]
    usual = _spread(folder, names, radius_mm)
    radii = [
        _radius(folder / name, about, stated or scan.ball_radius or None)
        for name, about, stated, scan in zip(names, files, usual, scans, strict=True)
    ]
    others = [
        n for n, used, stated in zip(names, radii, usual, strict=True) if stated not in (None, used)
    ]
    if others:
        warn(
            f"{folder}: the ball_radius_mm in capture.yaml of {', '.join(others)} is used instead "
            "of `radius_mm`; remove it from the file if it is wrong"
        )
    for name, scan in zip(names, scans, strict=True):
        _compare_marks(folder / name, scan)
    x0, y0 = layout.crop[:2] if layout.crop else (0, 0)
    marks = [(x - x0, y - y0, n) for n, scan in enumerate(scans) for x, y, _ in scan.balls]
    circles = [about.circle(center_px, contact_px) for about in files]
    return BallPresses(
        np.concatenate([each.image for each in captures], axis=1) if captures[1:] else first,
        first,
        np.asarray(radii, np.float32),
        np.asarray(circles, np.float32),
        names,
        np.array(marks, np.float32) if marks else None,
        captures[0].pixel_size,
    )


def _spread(
    folder: Path, names: list[str], radius_mm: float | tuple[float, ...] | None
) -> list[float | None]:
    """The radius that the parameter gives for each press."""
    if radius_mm is None:
        return [None] * len(names)
    radii = radius_mm if isinstance(radius_mm, tuple) else (radius_mm,)
    if len(radii) not in (1, len(names)):
        raise InputError(
            f"{folder}: presses: {len(names)}, radii in `radius_mm`: {len(radii)}; give one for "
            "all (a decimal number is written with a point), one for each in order of name, or "
            "write ball_radius_mm into each press's capture.yaml"
        )
    return [*radii] * (len(names) // len(radii))


def _radius(press: Path, about: CaptureFile, usual: float | None) -> float:
    radius = about.ball_radius_mm or usual
    if radius is None:
        raise InputError(
            f"{press}: the ball's radius is not known; give `radius_mm`=MM, "
            "or write it into the press's capture.yaml"
        )
    return radius


def _compare_marks(press: Path, scan: ListedCapture) -> None:
    """Warn where a scan's marks are not as large as its balls."""
    marked = float(np.median([radius for *_, radius in scan.balls])) if scan.balls else 0.0
    of_ball = scan.ball_radius / scan.pixel_size if scan.pixel_size else 0.0
    if marked and of_ball and abs(marked / of_ball - 1) > MAX_MARK_DIFFERENCE:
        warn(
            f"{press}: its balls are marked with a radius of {marked:.0f} px, but its radius and "
            f"pixel size make them {of_ball:.0f} px: settle the radius by `radius_mm`=MM, "
            "or give another pixel size"
        )
