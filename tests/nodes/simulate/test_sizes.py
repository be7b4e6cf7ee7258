"""A size that follows from a user's number is limited, which is checked before it is used."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.calibrate.ball.find_ball import find_ball
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_flat import shape_flat

LARGE = {"width_px": 16384, "height_px": 16384}


@pytest.mark.parametrize(
    "make",
    [
        lambda: shape_ball(**LARGE),
        lambda: shape_flat(**LARGE),
        lambda: press(np.zeros((8, 8), np.float32), 0.001, reach_mm=20),
        lambda: press(np.zeros((8, 8), np.float32), 0.001, skin_mm=5),
    ],
)
def test_a_size_that_would_take_too_much_memory_or_time_is_refused(make) -> None:
    with pytest.raises(InputError, match=r"million|fine pixels|px"):
        make()


@pytest.mark.parametrize("radius", [7000.0, 1e12])
def test_a_ball_that_fits_no_image_is_refused(radius: float) -> None:
    light = np.ones((4, 60, 80), np.float32)
    with pytest.raises(InputError, match="does not fit the image of 80 x 60"):
        find_ball(light, 0.0714, radius_mm=radius)


@pytest.mark.parametrize(
    "numbers",
    [
        {"pixel_size_mm": 1e-9},
        {"radius_mm": 1e300},
        {"changes": {"label.steepest": 1e300}},
        {"changes": {"shape.radius_mm": 1e-300}},
    ],
)
def test_absurd_numbers_are_refused_before_anything_runs(numbers, tmp_path: Path) -> None:
    numbers = dict(numbers)
    reads = {"capture": "none", "calibration": "none"}
    graph = "reconstruct" if "label" in str(numbers) else "simulate"
    changes = numbers.pop("changes", {})
    known = reads if graph == "reconstruct" else {"out": str(tmp_path)}
    with pytest.raises(InputError, match=r"less than|greater than|is needed"):
        open_pipeline(
            with_changes(read_graph(graph), changes), {**known, **numbers}, backend="numpy"
        )


@pytest.mark.parametrize(
    ("param", "value", "least"), [("pixel_size_mm", 0.00005, "0.0001"), ("camera_mm", 0.065, "5")]
)
def test_metres_are_refused_before_anything_runs(param: str, value: float, least: str) -> None:
    known = {"capture": "none", "ball_radius_mm": 7, "pixel_size_mm": 0.07, param: value}
    with pytest.raises(InputError, match=f"{param}.*or equal to {least}, not {value}"):
        open_pipeline("calibrate", known, backend="numpy")
