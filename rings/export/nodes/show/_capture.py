"""The content of captures: a folder of images of LEDs or colours, a scan, or a folder of such."""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.export.summary import Summary, section
from tactograph.sdk.nodes import read_capture

MAX_LISTED = 20
"""Most captures of a stream that are listed."""


def show_capture(folder: Path) -> Summary:
    """Return size and light of each image, and what is known besides.

    Raises
    ------
    InputError
        If it holds no capture.
    """
    first, *others = islice(read_capture(folder=folder), MAX_LISTED + 1)
    if not others:
        return Summary([f"{folder}: capture", *_lines(first)])
    count = f"over {MAX_LISTED}" if len(others) == MAX_LISTED else f"{1 + len(others)}"
    names = [f"  {capture.name}" for capture in [first, *others][:MAX_LISTED]]
    head = f"{folder}: {count} captures; the first:"
    return Summary([head, *_lines(first), *section("names", names)])


def _lines(capture: Any) -> list[str]:
    truths = {"height": capture.truth, "slope": capture.truth_slope, "shadow": capture.truth_shadow}
    names = [name for name, truth in truths.items() if truth is not None]
    count, rows, columns = capture.image.shape
    light = [
        f"  {number}: median {np.median(plane):.3f}, brightest {plane.max():.3f}"
        for number, plane in enumerate(capture.image, start=1)
    ]
    stated = [] if capture.pixel_size is None else [f"pixel: {capture.pixel_size:.4g} mm"]
    return [
        f"images: {count} lights of {columns} x {rows} pixels",
        *section("light, of full scale", light),
        *stated,
        *([f"truth: {', '.join(names)}"] if names else []),
    ]
