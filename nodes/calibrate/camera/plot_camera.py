"""Plot the marks found on a grid, and how a lens fits them."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Metrics
from tactograph.nodes.calibrate.camera.find_grid import GridMarks
from tactograph.nodes.capture.read_grey import GreyImage
from tactograph.nodes.drawing.chart import LIMIT_COLOUR, ORANGE, Page, pixel_ends
from tactograph.nodes.drawing.new_picture import BesidePicture, write_picture

ARROW_SHARE = 0.5
"""Length of an arrow for the root mean square, relative to the spacing of the marks."""


@node
def plot_camera(
    image: GreyImage,
    marks: GridMarks,
    departure: Annotated[F4, Port("N 2", "px", nan=True)],
    quality: Metrics,
    *,
    file: BesidePicture,
) -> None:
    """Draw the marks on the image, and arrows for their departures from the fit.

    Parameters
    ----------
    image
        H x W.
    marks
        As `find_grid` found them.
    departure
        N x 2 in px, as `fit_lens` returns it; NaN for marks that are left out.
    quality
        The figures, for the title.
    file
        The picture goes beside it: ``camera.npz`` gives ``camera.png``.
    """
    rows, columns = image.shape
    x, y = marks.place.T
    out = np.isnan(departure[:, 0])
    title = "  ".join(f"{name} {value:.4g}" for name, value in quality.items())
    page = Page(1200, 500, 1, 2, title)
    ends, labels = pixel_ends(image), ("x / px", "y / px")
    left = page.axes(0, 0, *ends, f"{marks.pattern}: {len(x)} found", labels, square=True)
    left.image(image)
    left.dots(x[~out], y[~out], ORANGE)
    left.dots(x[out], y[out], LIMIT_COLOUR, size_px=3.0)
    usual = float(np.sqrt(np.nanmean(np.sum(departure**2, axis=1))))
    spacing = float(np.sqrt(rows * columns / len(x)))
    scale = max(usual, 1e-9) / (ARROW_SHARE * spacing)
    said = f"departure from the fit; of {usual:.3f} px: half the space between marks"
    right = page.axes(0, 1, *ends, said, labels, square=True)
    right.arrows(x, y, *(departure.T / scale))
    write_picture(page, file.with_suffix(".png"))
