"""Compare a light model with a scan of the untouched film."""

from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.light_model_slope import light_model_slope
from tactograph.rings.metrology.nodes.scan.read_light_model import check_frame, on_cells
from tactograph.sdk import Crop, node, warn
from tactograph.sdk.nodes import coarsen, read_capture

MAX_UNTOUCHED_SLOPE = 0.02
"""Slope of flat film by its model above which heights bend: 0.02 is 20 um over a millimetre."""


@node
def judge_untouched(
    model: LightModel,
    *,
    folder: Path | None = None,
    crop: Crop | None = None,
    cell: Annotated[int, Interval(ge=0, le=64)] = 16,
) -> dict[str, float]:
    """Return how far the model takes untouched film for tilted, and warn where that is much.

    A model, with its own flat field, was made for the film of that day.  Film at rest is level:
    what slope it seems to have is what the model, the film or the light departs by.

    Parameters
    ----------
    model : as `read_light_model` gives it
    folder : a scan of the untouched film; None: nothing is compared
    crop : as for `read_capture`
    cell : side of a cell in pixels

    Returns
    -------
    dict
        ``untouched_slope``, root mean square, and ``untouched_brightness``, median; empty without
        a scan.

    Raises
    ------
    InputError
        As `read_capture` and `check_frame`.
    """
    if folder is None:
        return {}
    (capture,) = read_capture(folder=folder, crop=crop, single=True)
    check_frame(capture.image, model, f"{folder}")
    solved = light_model_slope(coarsen(capture.image, factor=cell), on_cells(model, cell))
    slope = float(np.sqrt(np.mean(np.sum(np.square(solved.slope), axis=0))))
    bright = float(np.median(solved.brightness))
    if slope > MAX_UNTOUCHED_SLOPE:
        warn(
            f"{folder}: the light model takes untouched film for tilted by {slope:.2g}, and "
            f"{bright:.2g} times as bright as its own: only film that is known to be flat "
            "keeps heights from bending; 'calibrate' learns this film from balls"
        )
    return {"untouched_slope": slope, "untouched_brightness": bright}
