"""Read the presses of a ball that check a film, if there are any."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.sdk import F4, InputError, Layout, Light, Port, SheetLight, StatedCircles, node
from tactograph.sdk.nodes import read_balls

NO_BALL_MM = 1e3
"""Radius in mm where no ball was given: so large that it limits nothing."""


class CheckPresses(NamedTuple):
    """P presses as a sheet, the first of them alone, and known properties of their balls."""

    image: SheetLight
    first: Light
    radius: Annotated[F4, Port("P", "mm")]
    circles: StatedCircles
    names: list[str]


@node
def read_check(
    flat: Light,
    *,
    folder: Path | None = None,
    radius_mm: Annotated[float, Gt(0)] | None = None,
    center_px: tuple[float, float] | None = None,
    contact_px: Annotated[float, Gt(0)] | None = None,
    layout: Layout,
) -> CheckPresses:
    """Read check presses as `read_balls` does; without a folder, return the film at rest.

    Parameters
    ----------
    flat : K x H x W, the film at rest, whose size every press must have
    folder : a capture, or a folder of captures; None: there is no check press
    radius_mm, center_px, contact_px : as for `read_balls`

    Raises
    ------
    InputError
        As `read_balls`; if presses and flat frame differ in size.
    """
    if folder is None:
        radius, circles = np.full(1, NO_BALL_MM, np.float32), np.zeros((1, 3), np.float32)
        return CheckPresses(flat, flat, radius, circles, [])
    balls = read_balls(
        folder=folder,
        radius_mm=radius_mm,
        center_px=center_px,
        contact_px=contact_px,
        **layout._asdict(),
    )
    if balls.first.shape != flat.shape:
        k, rows, columns = balls.first.shape
        raise InputError(
            f"{folder}: holds {k} lights of {columns} x {rows} pixels, but the calibration is for "
            f"{flat.shape[0]} lights of {flat.shape[2]} x {flat.shape[1]}"
        )
    return CheckPresses(*balls[:5])
