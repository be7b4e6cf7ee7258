"""Plot a one-shot sensor's calibration: where its presses lie, and how far off each comes out."""

import textwrap
from typing import Annotated

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.presses import Circles
from tactograph.sdk import F4, Colour, Light, NewPicture, Port, node

TITLE_LETTERS = 120
"""Letters in a line of the title."""


@node
def plot_presses(
    flat: Light,
    circle: Circles,
    selection: Annotated[NDArray[np.uint8], Port("B", "flag", high=1)],
    heldout_deg: Annotated[F4, Port("B", "deg")],
    verdict: str,
    advice: str,
    *,
    picture: NewPicture,
) -> None:
    """Draw the contacts on the film at rest, and each one's error by a calibration without it.

    Parameters
    ----------
    flat : K x H x W, the film at rest
    circle, selection
        B x 3 in px, and 1 for each that is used, as `fit_reflectance_map` returns them
    heldout_deg, verdict, advice : as `rate_presses` returns them
    file : the picture goes beside it: ``cal.npz`` gives ``cal.png``
    """
    figure = Figure(figsize=(12, 5), dpi=100, layout="constrained")
    film, errors = figure.subplots(1, 2)
    film.imshow(flat.mean(axis=0), cmap="gray")
    used = selection > 0
    for number, ((x, y, radius), is_used) in enumerate(zip(circle, used, strict=True), start=1):
        if radius > 0:
            colour = Colour.BLUE if is_used else Colour.ORANGE
            film.add_patch(Circle((x, y), radius, fill=False, edgecolor=colour))
            # On a plate: dark film and bright film hide letters of any colour.
            film.annotate(
                str(number), (x, y), ha="center", va="center", fontsize=8,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            )  # fmt: skip
    film.set(
        title=f"{used.sum()} contacts used (blue), {np.sum(~used & (circle[:, 2] > 0))} left out",
        xlabel="x / px",
        ylabel="y / px",
        xlim=(-0.5, flat.shape[2] - 0.5),
        ylim=(flat.shape[1] - 0.5, -0.5),
    )
    errors.bar(np.flatnonzero(used) + 1, heldout_deg[used], color=Colour.BLUE)
    errors.set(title="normal, held out / degrees", xlabel="contact, by number")
    lines = [textwrap.fill(line, TITLE_LETTERS) for line in (verdict, f"next: {advice}")]
    figure.suptitle("\n".join(lines), x=0.02, ha="left", fontsize=11)
    picture.write(figure)
