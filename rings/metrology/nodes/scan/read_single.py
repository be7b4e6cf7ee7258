"""Read one capture that all items of a stream share."""

from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import InputError, Layout, Light, PixelSize, node
from tactograph.sdk.nodes import read_capture


class SingleCapture(NamedTuple):
    """Images K x H x W, and mm per px where a scan states them."""

    image: Light
    pixel_size: PixelSize | None = None


@node
def read_single(*, folder: Path | None = None, layout: Layout) -> SingleCapture:
    """Read a capture, such as that of a known step, that is no item.

    Parameters
    ----------
    folder : the capture; None: what reads it has a condition that does not hold

    Raises
    ------
    InputError
        As `read_capture`; if there is none.
    """
    if folder is None:
        raise InputError("no capture was given; give one")
    (capture,) = read_capture(folder=folder, single=True, **layout._asdict())
    return SingleCapture(capture.image, capture.pixel_size)
