"""Read the many presses of a ball from which a one-shot sensor is calibrated."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.sdk import (
    F4,
    CaptureFile,
    Crop,
    InputError,
    Layout,
    Light,
    Lights,
    StatedCircles,
    node,
)
from tactograph.sdk.nodes import read_flat


class Presses(NamedTuple):
    """The captures, the film at rest, the captures' folders, and known contacts."""

    image: PressImages
    flat: Light
    names: list[str]
    circle: StatedCircles


@node
def read_presses(
    *,
    folder: Path | None = None,
    flat: Path,
    lights: Lights = "bgr",
    crop: Crop | None = None,
    smooth_px: Annotated[float, Interval(ge=0, le=100)] = 2.0,
) -> Presses:
    """Read every capture below `folder`, and the untouched film.

    Parameters
    ----------
    folder
        Holds one folder per press, each with one colour image of any name
        (``0/gelsight.png``, ``1/gelsight.png``, ...), or one image per LED; or is such a
        folder itself.  None: there is no press; the film at rest takes its place, without a
        name.
    flat : the untouched film: one colour image, or a folder like that of a press
    lights
        "bgr" or "rgb": the channels of a colour image are the lights.  "leds": one image per
        light.
    crop : x0, y0, x1, y1 in pixels; x1 and y1 are exclusive
    smooth_px : as for `read_flat`

    Returns
    -------
    Images P x K x H x W, flat K x H x W, the names of the P folders, and the contacts that their
    ``capture.yaml`` give (``ball_center_px``, ``ball_contact_px``), P x 3 in px.

    Raises
    ------
    InputError
        As `read_capture`; if `flat` is `folder`; if a press differs in size from the flat image.
    """
    film = read_film(flat, lights, crop, smooth_px)
    if folder is None:
        return Presses(film[None], film, [], np.full((1, 3), np.nan, np.float32))
    captures = Layout(lights, crop=crop).presses(folder, flat)
    names = [capture.name for capture in captures]
    circles = [CaptureFile.read(folder / name).circle() for name in names]
    images = np.stack([capture.image for capture in captures])
    if images.shape[1:] != film.shape:
        raise InputError(
            f"{folder / names[0]}: {images.shape[3]} x {images.shape[2]} pixels, but the untouched "
            f"film {flat} has {film.shape[2]} x {film.shape[1]}"
        )
    return Presses(images, film, names, np.asarray(circles, np.float32))


def read_film(place: Path, lights: Lights, crop: Crop | None = None, smooth_px: float = 2.0) -> F4:
    """Read the untouched film from one colour image or from a capture folder: K x H x W."""
    stack = Layout(lights, crop=crop).images(place)
    return read_flat(stack, folder=place, lights=lights, crop=crop, smooth_px=smooth_px).flat
