"""Read the untouched film, by which every image is divided."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError, node, warn
from tactograph.nodes import F4, Dark, Light
from tactograph.nodes.capture.read_capture import CaptureFile, Layout, read_capture
from tactograph.nodes.files.calibration_file import dark_led
from tactograph.nodes.files.image_files import check_size
from tactograph.nodes.optics.smoothed_light import smoothed_light


class Flat(NamedTuple):
    """The film at rest under each LED, and the image with all LEDs off."""

    flat: Light
    dark: Dark


@node
def read_flat(
    image: Light,
    estimate: Light | None = None,
    black: Dark | None = None,
    *,
    folder: Path | None = None,
    dark: Path | None = None,
    layout: Layout,
    smooth_px: Annotated[float, Interval(ge=0, le=100)] = 2.0,
) -> Flat:
    """Read the capture of the untouched film, or substitute an estimate or uniform light.

    Parameters
    ----------
    image : K x H x W, the capture whose size the flat frame must have
    estimate : K x H x W, used if there is no folder, from `estimate_flat`
    black : H x W, used if `dark` is not given; None: black
    folder
        Capture of the untouched film (or its one image, whose channels are the lights), or a
        folder of several, whose mean is less noisy.
        None: the estimate; without one, uniform light is assumed, with a warning.
    dark
        One image taken with all LEDs off; a ``capture.yaml`` beside it may give its ``bits``, else
        one of 16 bits has those of the untouched film.
    smooth_px : standard deviation of the Gaussian that smooths the flat image (`smoothed_light`)

    Raises
    ------
    InputError
        If the folder or image cannot be read, or differs in size from `image`; if an LED gives
        the film no more light than the dark image has.
    """
    height, width = image.shape[1:]
    if black is None:
        black = np.zeros((height, width), np.float32)
    if dark is not None:
        usual = None if folder is None else _bits_in(folder)
        black = layout.plane(dark, CaptureFile.read(dark.parent).bits, usual)
    check_size(dark, black.shape, "an image of the capture", (height, width))
    if folder is None and estimate is not None:
        return Flat(estimate, black)
    if folder is None:
        warn(
            "no flat frame was given: uneven light and vignetting are not corrected (`folder`=DIR)"
        )
        return Flat(np.ones_like(image), black)
    stack = _mean(image, folder, layout)
    flat = np.stack([smoothed_light(each - black, smooth_px) for each in stack])
    if (led := dark_led(flat)) is not None:
        raise InputError(
            f"{folder}: under LED {led} the film is no brighter than {dark or 'the dark image'}; "
            "`dark` is one image with all LEDs off"
        )
    return Flat(flat, black)


def _bits_in(folder: Path) -> int | None:
    """The depth that a capture states, or the first capture inside it that does."""
    inside = [d for d in sorted(folder.iterdir()) if d.is_dir()] if folder.is_dir() else []
    return next(filter(None, (CaptureFile.read(d).bits for d in (folder, *inside))), None)


def _mean(image: Light, folder: Path, layout: Layout) -> F4:
    """The mean of the captures in a folder, or the only capture."""
    total, count = np.zeros(image.shape, np.float64), 0
    for capture in read_capture(folder=folder, **layout._asdict()):
        advice = "; the untouched film is taken like the captures"
        check_size(folder / capture.name, capture.image.shape, "the capture", image.shape, advice)
        total += capture.image
        count += 1
    return np.asarray(total / count, np.float32)
