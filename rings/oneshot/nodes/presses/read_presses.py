"""Read the many presses of a ball from which a one-shot sensor is calibrated."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.sdk import CaptureFile, Crop, Layout, Light, Lights, StatedCircles, node
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
    flat : the untouched film: one colour image, or a folder like that of a press, or of several
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
        As `read_capture` and `read_flat`; if `flat` is `folder`.
    """
    layout = Layout(lights, crop=crop)
    captures = [] if folder is None else layout.presses(folder, flat)
    images = np.stack([each.image for each in captures] or [layout.images(flat)])
    film = read_flat(images[0], folder=flat, smooth_px=smooth_px, lights=lights, crop=crop).flat
    if folder is None:
        return Presses(film[None], film, [], np.full((1, 3), np.nan, np.float32))
    names = [capture.name for capture in captures]
    circles = [CaptureFile.read(folder / name).circle() for name in names]
    return Presses(images, film, names, np.asarray(circles, np.float32))
