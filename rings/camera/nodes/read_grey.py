"""Read one image, such as that of a grid on the film."""

from pathlib import Path
from typing import Annotated

from tactograph.sdk import F4, Layout, Port, node

GreyImage = Annotated[F4, Port("H W", "1")]
"""One image as a fraction of full scale."""


@node
def read_grey(*, file: Path, layout: Layout) -> GreyImage:
    """Read one image file as fractions of full scale.

    Parameters
    ----------
    file : 8 or 16 bit; PNG, TIFF, PGM or BMP
    layout : as for `read_capture`; of one image, its crop and channel count

    Raises
    ------
    InputError
        If the file is missing, damaged or of another depth, or the crop exceeds it.
    """
    return layout.plane(file)
