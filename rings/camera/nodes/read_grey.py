"""Read one image, such as that of a grid on the film."""

from pathlib import Path
from typing import Annotated

from tactograph.sdk import F4, Crop, Layout, Port, node
from tactograph.sdk.unstable import Channel

GreyImage = Annotated[F4, Port("H W", "1")]
"""One image as a fraction of full scale."""


@node
def read_grey(*, file: Path, crop: Crop | None = None, channel: Channel | None = None) -> GreyImage:
    """Read one image file as fractions of full scale.

    Parameters
    ----------
    file : 8 or 16 bit; PNG, TIFF, PGM or BMP
    crop : x0, y0, x1, y1 in pixels; x1 and y1 are exclusive
    channel : the channel of a colour image; None: the mean of all three

    Raises
    ------
    InputError
        If the file is missing, damaged or of another depth, or the crop exceeds it.
    """
    return Layout(crop=crop, channel=channel).plane(file)
