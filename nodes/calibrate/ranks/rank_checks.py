"""What the checks of a touch say of right touches of a sensor, drawn from its calibration."""

import tempfile
import warnings
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import load, node
from tactograph.graph.disk.array_files import load_arrays
from tactograph.nodes import F8, Light
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND
from tactograph.nodes.calibrate.file.press_calibration import PRESS_CALIBRATION
from tactograph.nodes.files.calibration_file import is_of_kind, replace_arrays
from tactograph.nodes.optics.lens import LENS_TERMS
from tactograph.nodes.trust.check_ranks import NO_RANKS, figures_of, ranked
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.touch_evidence import TouchEvidence

MAX_PIXELS = 40000
"""Larger images are drawn on fewer, larger pixels: their checks look at as many cells at most."""
RIGHT_SHARE = 1e-3
"""Error of a height over the image's width up to which a touch is right: 16 um of 16 mm."""
THREE_LEDS = 3
"""Lights whose directions are never linearly dependent (paper, section 3.2)."""
LINE_PORTS = ("across_row", "along_row", "across_column")


@node
def rank_checks(
    flat: Light | None = None,
    *,
    file: Path,
    count: Annotated[int, Interval(ge=10, le=100000)] = 128,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> None:
    """Draw right touches of a calibrated sensor, check them, and keep the ranks in its file.

    The touches are seen by the calibration's own model, within all that it leaves open
    (`draw_touches`), and reconstructed by the graphs themselves.  Those whose height is off are
    left out.

    Parameters
    ----------
    flat : K x H x W, what has just been written; without it the file is there already
    file : the calibration, which is written again
    count, seed : how many touches are drawn; the same for the same seed
    """
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the calibration has told of its doubts
        small, arrays = Path(folder) / "small.npz", load_arrays(file)
        np.savez(small, **_smaller(arrays))  # type: ignore[arg-type]
        given = {"calibration": str(small), "count": count, "seed": seed}
        if is_of_kind(file, PRESS_CALIBRATION):
            kind, ranks = PRESS_CALIBRATION, [_ranks("gelsight_mini", "drawn_presses", given)] * 3
        else:
            # Three lights are never linearly dependent, so the paper's shadow test takes four.
            tables = "paper" if len(arrays["flat"]) > THREE_LEDS else "paper_no_shadow"
            walls = given | {"count": max(count // 2, 1), "rigid": True}
            kind, ranks = (
                CALIBRATION_KIND,
                [
                    _ranks("reconstruct", "drawn_touches", given),
                    _ranks("reconstruct", "drawn_touches", walls),
                    _ranks(tables, "drawn_touches", given),
                ],
            )
    replace_arrays(file, kind, {"ranks": np.stack(ranks)})


def _smaller(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """A calibration of the same film on at most `MAX_PIXELS` pixels, without a lens."""
    rows, columns = arrays["flat"].shape[1:]
    coarser = max(1.0, np.sqrt(rows * columns / MAX_PIXELS))
    size = round(columns / coarser), round(rows / coarser)
    flat = [cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in arrays["flat"]]
    made = {"flat": np.stack(flat), "pixel_size": arrays["pixel_size"] * columns / size[0]}
    for plane in {"dark", "rest"} & arrays.keys():
        made[plane] = cv2.resize(arrays[plane], size, interpolation=cv2.INTER_AREA)
    made["area"] = np.ones(size[::-1], np.uint8)
    return arrays | made | {"lens": np.zeros(len(LENS_TERMS), np.float32), "ranks": NO_RANKS}


def _ranks(graph: str, overlay: str, given: dict[str, Any]) -> F8:
    """The quantiles of the figures of drawn touches whose height the graph finds.

    At least half of them count as found: a graph may be no better than that.  Walls are what
    another graph measures, so that all of them count.
    """
    figures, off = [], []
    with load({"format": 1, "extends": [graph, overlay]}, given) as pipeline:
        for result in pipeline.items():
            found = result.outputs
            evidence = TouchEvidence(found["level"], found["figures"])
            lines = LineChanges(*(found[n] for n in LINE_PORTS)) if LINE_PORTS[0] in found else None
            figures.append(figures_of(evidence, float(found.get("added", 0.0)), lines))
            wrong = np.square(found["height"] - found["truth"], dtype=np.float64).mean()
            off.append(np.sqrt(wrong) / (float(found["pixel"]) * found["height"].shape[1]))
    most = np.inf if given.get("rigid") else max(RIGHT_SHARE, np.median(off))
    return ranked(np.array(figures)[np.array(off) <= most])
