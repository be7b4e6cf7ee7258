"""A touch under other light than the calibration's gives a warning, not just a height."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result
from tests.conftest import RIG_PIXEL_MM, Calibration, Raytraced, without_pictures

SAME = (1, 2, 3, 4)


def run(graph: str, capture: Path, calibration: Path) -> Result:
    given = {"capture": str(capture), "calibration": str(calibration)}
    (result,) = open_pipeline(without_pictures(read_graph(graph)), given, sinks=False).items()
    return result


def written(capture: Path, out: Path, order: tuple[int, ...] = SAME, gamma: float = 1.0) -> Path:
    """A capture whose images are those of other LEDs, or of a camera with another response."""

    def seen(led: int) -> NDArray[np.uint8]:
        image = cv2.imread(str(capture / f"led{led}.png"), cv2.IMREAD_UNCHANGED)
        return np.asarray(np.round(255 * (image / 255) ** gamma), np.uint8)

    out.mkdir()
    for place, led in enumerate(order, start=1):
        cv2.imwrite(str(out / f"led{place}.png"), seen(led))
    return out


def tells_of_misfit(result: Result) -> bool:
    return any("the light fits no surface" in warning for warning in result.warnings)


@pytest.mark.parametrize("graph", ["reconstruct", "precise"])
@pytest.mark.parametrize("shape", ["sphere", "cat", "sphere_film", "cat_film"])
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_light_as_calibrated_raises_no_warning(
    raytraced: Raytraced, calibration: Calibration, graph: str, rig: str, shape: str
) -> None:
    result = run(graph, raytraced / rig / shape, calibration(rig))
    assert not tells_of_misfit(result)


@pytest.mark.parametrize(
    ("rig", "order", "gamma"),
    [
        ("far28", (2, 1, 3, 4), 1.0),
        ("near33", (2, 1, 3, 4), 1.0),
        ("near33", (2, 3, 4, 1), 1.0),
        ("near33", (1, 1, 3, 4), 1.0),
        ("near33", SAME, 1 / 2.2),
    ],
)
def test_images_in_another_order_or_with_gamma_are_told(
    raytraced: Raytraced,
    calibration: Calibration,
    tmp_path: Path,
    rig: str,
    order: tuple[int, ...],
    gamma: float,
) -> None:
    capture = written(raytraced / rig / "sphere_film", tmp_path / "touch", order, gamma)
    assert tells_of_misfit(run("reconstruct", capture, calibration(rig)))


def test_precise_tells_it_too(
    raytraced: Raytraced, calibration: Calibration, tmp_path: Path
) -> None:
    capture = written(raytraced / "near33" / "sphere_film", tmp_path / "touch", (2, 1, 3, 4))
    assert tells_of_misfit(run("precise", capture, calibration("near33")))


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_a_good_calibration_raises_no_warning(
    raytraced: Raytraced, tmp_path: Path, rig: str
) -> None:
    folder = raytraced / rig
    given = {"capture": str(folder / "calibration"), "flat": str(folder / "flat")}
    scale = {"ball_radius_mm": 7.0, "pixel_size_mm": RIG_PIXEL_MM[rig]}
    values = {**given, **scale, "out": str(tmp_path / "cal.npz")}
    (result,) = open_pipeline(read_graph("calibrate"), values).items()
    assert not result.warnings
