"""What a sensor's light model says before a calibration: light at rest, LEDs, pixel size."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.rings.metrology.nodes.scan.judge_light_model import judge_light_model
from tactograph.rings.metrology.nodes.scan.judge_untouched import judge_untouched
from tactograph.rings.metrology.nodes.scan.light_model import (
    PIXEL_UNKNOWNS,
    coefficients,
    modelled_light,
    monomials,
)
from tactograph.rings.metrology.nodes.scan.light_model_slope import light_model_slope
from tactograph.rings.metrology.nodes.scan.read_light_model import (
    check_frame,
    on_cells,
    read_light_model,
)
from tactograph.rings.metrology.nodes.scan.scan_pixel_size import scan_pixel_size
from tactograph.sdk import F4, Crop, Light, PixelSize, Port, node
from tactograph.sdk.nodes import coarsen

CELL_PX = 16
"""Side of the cells on which the model is compared with images, in px."""
MIN_LIGHT_TOWARDS = 1e-3
"""Smallest light of level film by the linear model."""


class Start(NamedTuple):
    """What a light model says."""

    metrics: dict[str, float]
    rest: Light | None = None
    slants: Annotated[F4, Port("K 2", "1", low=-1, high=1)] | None = None
    """L_x / L_z and L_y / L_z of each LED, from the middle of the frame."""
    pixel_size: PixelSize | None = None


@node
def read_start(
    image: Light,
    stated: PixelSize | None = None,
    *,
    file: Path,
    flat: Path | None = None,
    crop: Crop | None = None,
) -> Start:
    """Read a light model as the start of a calibration, and compare it with what was taken.

    Parameters
    ----------
    image : K x H x W, a press
    stated : mm per px, as a scan states it
    file, crop : as for `read_light_model`
    flat : a capture of the untouched film, which is compared with the model and its flat field

    Returns
    -------
    Figures of `judge_light_model` and `judge_untouched`, of four LEDs or more; the light of level
    film by the model, K x H x W; K x 2; mm per px.

    Raises
    ------
    InputError
        As `read_light_model`; if the model has other LEDs, or another frame, than the press.
    """
    model, of_model = read_light_model(file=file, crop=crop)
    check_frame(image, model, "the press")
    u, v = np.meshgrid(model.u, model.v)
    powers = monomials(u, v, int(model.degree))
    level = np.zeros((3, *image.shape[1:]), np.float32)
    level[2] = 1
    rest, _ = modelled_light(coefficients(model.quadratic, powers), level)
    towards = model.linear[:, :, 0]
    slants = towards[:, :2] / np.maximum(towards[:, 2:], MIN_LIGHT_TOWARDS)
    figures: dict[str, float] = {}
    if len(image) > PIXEL_UNKNOWNS:
        on_coarse_cells = coarsen(image, factor=CELL_PX), on_cells(model, CELL_PX)
        solved = light_model_slope(*on_coarse_cells)
        figures = judge_light_model(solved, *on_coarse_cells, only_warn=True)
        figures |= judge_untouched(model, folder=flat, crop=crop, cell=CELL_PX)
    rest = rest if model.gain is None else rest / model.gain
    return Start(figures, rest, slants, scan_pixel_size(of_model, stated))
