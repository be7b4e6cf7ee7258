"""Write pictures of calibrations, which replace earlier pictures of that kind and no other file."""

from pathlib import Path
from typing import Annotated

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from pydantic import AfterValidator

from tactograph.graph.disk.atomic_files import atomic_file

ORANGE, BLUE, GREY = "#ffb000", "#3c8fe6", "#9a9a9a"
"""Colours of plots, distinguishable with any colour vision."""
DRAWN_BY = "Matplotlib"
"""Beginning of a picture's text chunk ``Software``."""


def write_picture(figure: Figure, file: Path) -> None:
    """Write a figure as PNG, completely or not at all; that of a calibration next to its file.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    with atomic_file(_picture_of(file)) as target:
        FigureCanvasAgg(figure).print_png(target, pil_kwargs={"compress_level": 1})


def _picture_of(file: Path) -> Path:
    return file.with_suffix(".png") if file.suffix == ".npz" else file


def _is_free(picture: Path) -> bool:
    """Return whether there is no such file, or one that Matplotlib drew."""
    if not picture.exists():
        return True
    try:
        with Image.open(picture) as image:
            return str(image.info.get("Software", "")).startswith(DRAWN_BY)
    except OSError:
        return False


def _free(file: Path) -> Path:
    if not _is_free(picture := _picture_of(file)):
        raise ValueError(
            f"{picture} exists and is no picture of a calibration; another name is needed"
        )
    return file


NewPicture = Annotated[Path, AfterValidator(_free)]
"""Path of a picture, or of a calibration whose picture goes next to it, ``.png`` for ``.npz``; a
file of another kind is refused before the work starts."""
