"""Plot the marks found on a grid, and how a lens fits them."""

from typing import Annotated

import numpy as np
from matplotlib.figure import Figure

from tactograph.rings.camera.nodes.find_grid import GridMarks
from tactograph.rings.camera.nodes.read_grey import GreyImage
from tactograph.sdk import F4, Colour, NewPicture, Port, node

ARROW_SHARE = 0.5
"""Length of an arrow for the root mean square, relative to the spacing of the marks."""


@node
def plot_camera(
    image: GreyImage,
    marks: GridMarks,
    departure: Annotated[F4, Port("N 2", "px", nan=True)],
    quality: dict[str, float],
    *,
    picture: NewPicture,
) -> None:
    """Draw the marks on the image, and arrows for their departures from the fit.

    Parameters
    ----------
    image : H x W
    marks : as `find_grid` found them
    departure : N x 2 in px, as `fit_lens` returns it; NaN for marks that are left out
    quality : the figures, for the title
    file : the picture goes beside it: ``camera.npz`` gives ``camera.png``
    """
    rows, columns = image.shape
    x, y = marks.place.T
    out = np.isnan(departure[:, 0])
    figure = Figure(figsize=(12, 5), dpi=100, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.imshow(image, cmap="gray")
    left.plot(x[~out], y[~out], "+", color=Colour.ORANGE, markersize=5)
    left.plot(x[out], y[out], "x", color="red", markersize=6)
    left.set(title=f"{marks.pattern}: {len(x)} found", xlabel="x / px", ylabel="y / px")
    usual = float(np.sqrt(np.nanmean(np.sum(departure**2, axis=1))))
    spacing = float(np.sqrt(rows * columns / len(x)))
    scale = max(usual, 1e-9) / (ARROW_SHARE * spacing)
    arrows = right.quiver(
        x,
        y,
        *departure.T,
        angles="xy",
        scale_units="xy",
        scale=scale,
        color=Colour.BLUE,
        width=0.003,
    )
    right.quiverkey(arrows, 0.85, 1.03, usual, f"{usual:.3f} px")
    right.set(xlim=(0, columns), ylim=(rows, 0), xlabel="x / px", ylabel="y / px")
    right.set(aspect="equal", title="departure from the fit")
    figure.suptitle("  ".join(f"{name} {value:.4g}" for name, value in quality.items()), fontsize=9)
    picture.write(figure)
