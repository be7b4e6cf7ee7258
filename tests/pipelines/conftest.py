"""Graphs run on captures of ray-traced rigs, as they are or with their images changed."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import Source, read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result
from tests.fixtures import (
    Calibration,
    Raytraced,
    images_of,
    of_matt_film,
    without_pictures,
    without_ranks,
)

Image = NDArray[Any]


def run(
    graph: Source,
    out: Path | None = None,
    backend: str | None = None,
    changes: dict[str, object] | None = None,
    ranked: bool = True,
    **params: object,
) -> Result:
    """The result of a graph; files are written only if `out` names a folder.

    A calibration that is not `ranked` is ten times as fast, and its touches are not checked.
    """
    if out is not None:
        params["out"] = out
    bare = without_pictures(read_graph(graph))
    changed = with_changes(bare if ranked else without_ranks(bare), changes or {})
    (result,) = open_pipeline(changed, params, backend=backend, sinks=out is not None).items()
    return result


def errors(graph: Any, params: dict[str, Any], count: int, *, least_mm: float = 0.0) -> list[float]:
    """Root mean square errors in mm of `count` heights of a simulated live sensor.

    Films that are nowhere as high as `least_mm` do not count.
    """
    rms_mm: list[float] = []
    with open_pipeline(graph, params) as pipeline:
        for result in pipeline.items():
            truth = next(array for value, array in result.item.items() if value.port == "truth")
            if truth.max() >= least_mm:
                rms_mm.append(float(np.sqrt(np.mean((result["height"] - truth) ** 2))))
            if len(rms_mm) == count:
                break
    return rms_mm


Reconstruct = Callable[..., Result]


@pytest.fixture(scope="session")
def reconstruct(raytraced: Raytraced, calibration: Calibration) -> Reconstruct:
    """Run a graph on a capture of a ray-traced rig, with that rig's calibration."""

    def run_it(graph: str, rig: str, shape: str, **more: Any) -> Result:
        capture = raytraced / rig / shape
        return run(graph, capture=capture, calibration=calibration(rig), **more)

    return run_it


def changed(capture: Path, out: Path, change: Callable[[Image], Image]) -> Path:
    """A copy of a capture, each of its images changed."""
    shutil.copytree(capture, out)
    for file in out.glob("led*.png"):
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(file), np.rint(change(image)).astype(image.dtype))
    return out


def changed_rig(rig: Path, out: Path, shapes: list[str], change: Callable[[Image], Image]) -> None:
    """A rig of matt film that another camera sees, and its calibration."""
    for capture in ("flat", "calibration", *shapes):
        changed(rig / capture, out / capture, change)
    images = {"capture": out / "calibration", "flat": out / "flat"}
    calibrate = of_matt_film(read_graph("calibrate"))
    run(calibrate, out / "cal.npz", ranked=False, **images_of(rig) | images)
