"""Write pictures of calibrations, which replace earlier pictures of that kind and no other file."""

import os
from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from PIL import Image
from pydantic import AfterValidator

from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.errors import WriteError

FIGURES_IN = 3.2
"""Width in inches of the list of figures on the right of a page."""
DRAWN_BY = "Matplotlib"
"""Beginning of a picture's text chunk ``Software``."""


class Colour(StrEnum):
    """Colours of plots, distinguishable with any colour vision."""

    ORANGE = "#ffb000"
    BLUE = "#3c8fe6"
    GREY = "#9a9a9a"


def _list_figures(page: Figure, figures: Mapping[str, float], top: float) -> None:
    """Write figures on the right of a page, one a line, and keep a layout to their left."""
    values = {
        name: f"{int(value)}" if float(value).is_integer() else f"{value:.4g}"
        for name, value in figures.items()
    }
    longest = max(map(len, values), default=0)
    text = "\n".join(f"{name:<{longest}} {value:>9}" for name, value in values.items())
    left = 1 - FIGURES_IN / page.get_figwidth()
    layout = page.get_layout_engine()
    if isinstance(layout, ConstrainedLayoutEngine):
        layout.set(rect=(0, 0, left, 1))
    page.text(left, top, text, family="monospace", fontsize=8.5, linespacing=1.5, va="top")


def _picture_of(file: Path) -> Path:
    return file.with_suffix(".png") if file.suffix == ".npz" else file


def _free(file: Path) -> Path:
    """Return a path where there is no picture, or one that Matplotlib drew."""
    picture, drawn_by = _picture_of(file), ""
    with suppress(OSError), Image.open(picture) as image:
        drawn_by = str(image.info.get("Software", ""))
    if picture.exists() and not drawn_by.startswith(DRAWN_BY):
        raise ValueError(
            f"{picture} exists and is no picture of a calibration; another name is needed"
        )
    around = next(folder for folder in file.absolute().parents if folder.exists())
    if not (around.is_dir() and os.access(around, os.W_OK)):
        raise ValueError(f"{around} is no folder that can be written to; another place is needed")
    return file


class NewPicture(NamedTuple):
    """The picture that a node draws.

    Parameters
    ----------
    file
        Its path, or that of a calibration that it goes next to, ``.png`` for ``.npz``; a file of
        another kind, or a place that cannot be written to, is refused before the work starts.
    """

    file: Annotated[Path, AfterValidator(_free)]

    def write(
        self, figure: Figure, figures: Mapping[str, float] | None = None, top: float = 1.0
    ) -> None:
        """Write a figure as PNG, completely or not at all.

        It may list `figures` on the right, from `top` on, a share of the page counted from its
        bottom.

        Raises
        ------
        WriteError
            If it cannot be written, or a file of another kind has that name.
        """
        try:
            picture = _picture_of(_free(self.file))
        except ValueError as error:
            raise WriteError(str(error)) from None
        if figures is not None:
            _list_figures(figure, figures, top)
        with atomic_file(picture) as target:
            FigureCanvasAgg(figure).print_png(target, pil_kwargs={"compress_level": 1})
