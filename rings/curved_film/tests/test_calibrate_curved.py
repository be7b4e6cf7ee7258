"""A sensor whose film is no plane: its shape by a drawing, or found from presses."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tests.fixtures import ROOT, SHARED
from tests.pipelines.conftest import run


@pytest.mark.slow
def test_a_round_sensor_goes_from_its_drawing_to_heights(tmp_path: Path) -> None:
    rig, file = ROOT / "tests/data/dome", tmp_path / "cal.npz"
    arguments = {"ball_radius_mm": 6.0, "pixel_size_mm": 10 / 70, "rest_radius_mm": 35.0}
    run("calibrate_curved", file, capture=rig / "presses", flat=rig / "flat", **arguments)
    off, band = {}, 0.0
    for graph in ("paper", "reconstruct", "precise"):
        found = run(graph, capture=rig / "cat_film", calibration=file)["metrics"]
        assert found["trust"] > 0.01, graph
        off[graph], band = found["rmse_um"], found.get("in_90_percent_band", 0.0)
    assert (off["paper"] < 90, off["reconstruct"] < 3, off["precise"] < 1.5) == (True,) * 3, off
    assert band > 85


@pytest.mark.slow
def test_a_round_film_is_found_from_presses_and_says_how_well(tmp_path: Path) -> None:
    """What is not known of its curvature is not known of the scale of heights above it."""
    rig, file = ROOT / "tests/data/dome", tmp_path / "cal.npz"
    arguments = {"ball_radius_mm": 6.0, "pixel_size_mm": 10 / 70, "rest": "find"}
    figures = run(
        "calibrate_curved", file, capture=rig / "presses", flat=rig / "flat", **arguments
    )["quality"]
    found = read_calibration(file=file)
    assert found.rest is not None
    off_um = 1e3 * np.std(found.rest - np.load(rig / "rest_height_mm.npy"))
    assert off_um < 2 * figures["rest_deviation_um"] < 80
    radius = figures["rest_radius_x_mm"]
    assert abs(35 / radius - 1) / 35 / (1 / 6 + 1 / radius) < 2 * found.scale_error < 0.01


def test_a_film_is_not_found_without_its_own_light(tmp_path: Path) -> None:
    arguments = {"ball_radius_mm": 6.0, "pixel_size_mm": 10 / 70, "rest": "find"}
    with pytest.raises(InputError, match="needs flat"):
        run(
            "calibrate_curved",
            tmp_path / "cal.npz",
            capture=ROOT / "tests/data/dome/presses",
            **arguments,
        )


@pytest.mark.slow
def test_a_round_film_declared_flat_is_named(tmp_path: Path) -> None:
    """In place of the ball's radius, the pixel size or the images' order."""
    rig = ROOT / "tests/data/dome"
    arguments = {"ball_radius_mm": 6.0, "pixel_size_mm": 10 / 70}
    images = {"capture": rig / "presses", "flat": rig / "flat"}
    doubt, *_ = run("calibrate", tmp_path / "cal.npz", **images, **arguments).warnings
    assert re.search(r"no plane at rest: a bend with a radius of 3\d.* odds of", doubt)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "quick_um", "careful_um"), [("dome_ideal", 3.0, 1.5), ("dome", 8.0, 4.0)]
)
def test_a_ray_traced_dome_is_calibrated_and_measured(
    rig: str, quick_um: float, careful_um: float, tmp_path: Path
) -> None:
    scene = SHARED / "raytraced" / rig
    if not scene.is_dir():
        pytest.skip("the ray-traced domes are not here")
    for press in ("calibration", "calibration_off", "calibration_left"):
        shutil.copytree(scene / press, tmp_path / "presses" / press)
    file, rest = tmp_path / "cal.npz", np.load(scene / "rest_height_mm.npy")
    arguments = {"capture": tmp_path / "presses", "flat": scene / "flat", "ball_radius_mm": 6.0}
    arguments |= {"rest": scene / "rest_height_mm.npy", "pixel_size_mm": 5 / 70}
    run("calibrate_curved", file, **arguments, **({"camera_mm": 65.0} if rig == "dome" else {}))
    for shape in ("sphere_film", "corner_film", "cat_film"):
        above = np.load(scene / shape / "truth_height_mm.npy") - rest
        for graph, most in (("reconstruct", quick_um), ("precise", careful_um)):
            found = run(graph, capture=scene / shape, calibration=file)
            assert 1e3 * np.sqrt(np.mean((found["height"] - above) ** 2)) < most, (shape, graph)
            assert found["metrics"]["trust"] > 0.01, (shape, graph)


def test_a_shape_for_the_plain_calibration_is_refused_with_the_overlays_name() -> None:
    with pytest.raises(InputError, match=r"no param 'rest_radius_mm', but .*--with curved_film"):
        read_graph("calibrate").read_words(["rest_radius_mm=9"])
