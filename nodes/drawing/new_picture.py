"""Write pictures of calibrations, which replace earlier pictures of that kind and no other file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from pydantic import AfterValidator

from tactograph.graph.disk.atomic_files import atomic_file

ORANGE, BLUE, GREY = "#ffb000", "#3c8fe6", "#9a9a9a"
"""Colours of plots, distinguishable with any colour vision."""
FIGURES_PER_LINE = 5
"""Figures per line of a title."""
DRAWN_BY = "Matplotlib"
"""Beginning of a picture's text chunk ``Software``."""


def write_picture(figure: Figure, file: Path) -> None:
    """Write a figure as PNG, completely or not at all.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    with atomic_file(file) as target:
        FigureCanvasAgg(figure).print_png(target, pil_kwargs={"compress_level": 1})


def in_lines(figures: Sequence[str]) -> str:
    """Return figures as a title of several lines."""
    return "\n".join(
        "  ".join(figures[i : i + FIGURES_PER_LINE])
        for i in range(0, len(figures), FIGURES_PER_LINE)
    )


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
    if not _is_free(file):
        raise ValueError(
            "the name of a new file, or of an earlier picture of a calibration, is needed"
        )
    return file


def _free_beside(file: Path) -> Path:
    picture = file.with_suffix(".png")
    if not _is_free(picture):
        raise ValueError(
            f"{picture} exists and is no picture of a calibration; another name is needed"
        )
    return file


NewPicture = Annotated[Path, AfterValidator(_free)]
"""Path of a picture; a file of another kind is refused before the work starts."""
BesidePicture = Annotated[Path, AfterValidator(_free_beside)]
"""Path of a calibration whose picture is written beside it, ``.png`` for ``.npz``."""
