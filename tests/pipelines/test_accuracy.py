"""What the shipped graphs find, against the truth of captures by an independent renderer."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result
from tests.conftest import (
    RIG_PIXEL_MM,
    Calibration,
    MadeOnce,
    Raytraced,
    images_of,
    without_pictures,
)


def run(
    graph: str,
    out: Path | None = None,
    backend: str | None = None,
    changes: dict[str, object] | None = None,
    **given: object,
) -> Result:
    """What a graph finds; files are written only if `out` says where."""
    if out is not None:
        given["out"] = out
    changed = with_changes(without_pictures(read_graph(graph)), changes or {})
    (result,) = open_pipeline(changed, given, backend=backend, sinks=out is not None).items()
    return result


Reconstruct = Callable[..., Result]


@pytest.fixture
def reconstruct(raytraced: Raytraced, calibration: Calibration) -> Reconstruct:
    """Run a graph on a capture of a ray-traced rig, with that rig's calibration."""

    def run_it(
        graph: str, rig: str, shape: str, backend: str | None = None, out: Path | None = None
    ) -> Result:
        capture = raytraced / rig / shape
        return run(graph, out, backend, capture=capture, calibration=calibration(rig))

    return run_it


@pytest.mark.one_case
@pytest.mark.parametrize(("rig", "scale"), [("far28", 1), ("far28_vga16", 2)])
def test_shadow_handling_on_the_papers_hard_case(
    reconstruct: Reconstruct, rig: str, scale: int
) -> None:
    found = {
        graph: reconstruct(graph, rig, "sphere")["metrics"]
        for graph in ("paper", "paper_no_shadow")
    }
    assert found["paper"]["peak_px"] == pytest.approx(70 * scale, abs=0.1)
    assert found["paper"]["max_error_px"] <= 11 * scale
    assert found["paper"]["over_10_percent"] <= 3
    without = found["paper_no_shadow"]
    assert found["paper"]["max_error_px"] < 0.75 * without["max_error_px"]
    assert found["paper"]["over_10_percent"] < 0.5 * without["over_10_percent"]


FILMS = {
    ("far28", "sphere_film"): 0.02,
    ("far28", "cat_film"): 0.03,
    ("near33", "sphere_film"): 0.02,
    ("near33", "cat_film"): 0.03,
    ("far28_vga16", "sphere_film"): 0.02,
    ("far28_vga16", "cat_film"): 0.1,
}
"""Root mean square error of the height in px, of film pressed by 27 to 84 px."""


@pytest.mark.parametrize(("rig", "shape"), FILMS)
def test_reconstruct_reaches_its_error_on_soft_presses(
    reconstruct: Reconstruct, rig: str, shape: str
) -> None:
    found = reconstruct("reconstruct", rig, shape)["metrics"]
    assert found["rmse_px"] <= FILMS[rig, shape]


def as_a_colour_camera_sees(image: NDArray[Any]) -> NDArray[Any]:
    """Every second pixel of every second row, and what bilinear interpolation makes between."""
    seen = np.zeros(image.shape, np.float32)
    seen[::2, ::2] = image[::2, ::2]
    taps = np.array([0.5, 1, 0.5], np.float32)
    filled = cv2.sepFilter2D(seen, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101)
    return np.round(filled).astype(image.dtype)


@pytest.fixture(scope="session")
def colour_rig(raytraced: Raytraced, made_once: MadeOnce) -> Path:
    """A ray-traced rig seen by a camera that interpolates colours: neighbours share noise."""

    def write(folder: Path) -> None:
        for capture in ("flat", "calibration", "sphere_film", "cat_film"):
            shutil.copytree(raytraced / "far28" / capture, folder / capture)
        for file in folder.rglob("led*.png"):
            image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
            cv2.imwrite(str(file), as_a_colour_camera_sees(image))
        given = {"capture": folder / "calibration", "flat": folder / "flat", "ball_radius_mm": 7.0}
        place = {"pixel_size_mm": RIG_PIXEL_MM["far28"]}
        run("calibrate", folder / "cal.npz", **given, **place)

    return made_once("far28_colour", write)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["sphere_film", "cat_film"])
def test_the_stated_error_holds_where_neighbours_share_noise(colour_rig: Path, shape: str) -> None:
    given = {"capture": colour_rig / shape, "calibration": colour_rig / "cal.npz"}
    found = run("precise", **given)
    assert 85 <= found["metrics"]["in_90_percent_band"] <= 98
    assert (np.abs(found["height"]) < 1e-9).mean() > 0.4


def test_the_height_fed_back_is_what_near_lights_need(reconstruct: Reconstruct) -> None:
    without = reconstruct("reconstruct_far", "near33", "sphere_film")
    assert without["metrics"]["rmse_px"] > 10 * FILMS["near33", "sphere_film"]


@pytest.mark.parametrize("shape", ["sphere_film", "cat_film"])
def test_where_light_comes_from_needs_no_full_resolution(
    reconstruct: Reconstruct, shape: str
) -> None:
    coarse, full = (
        reconstruct(graph, "near33", shape) for graph in ("reconstruct", "reconstruct_full")
    )
    apart = np.abs(coarse["height"] - full["height"]) / RIG_PIXEL_MM["near33"]
    assert np.sqrt(np.mean(apart**2)) < 0.005
    assert apart.max() < 0.1


@pytest.mark.parametrize("shape", ["sphere_film", "cat_film"])
def test_larger_cells_do_for_the_rough_height(
    raytraced: Raytraced, calibration: Calibration, shape: str
) -> None:
    capture = raytraced / "near33" / shape
    found = run("reconstruct", capture=capture, calibration=calibration("near33"), cell_px=8)
    assert found["metrics"]["rmse_px"] <= FILMS["near33", shape]


def test_labels_are_what_shadows_need(reconstruct: Reconstruct) -> None:
    without = reconstruct("reconstruct_no_shadow", "near33", "cat_film")
    assert without["metrics"]["rmse_px"] > 2 * FILMS["near33", "cat_film"]


@pytest.mark.slow
def test_three_lights_are_enough(raytraced: Raytraced, tmp_path: Path) -> None:
    rig = raytraced / "near33"
    three = {"frames.leds": [1, 2, 3]}
    calibrated = tmp_path / "three.npz"
    taken = {"taken.leds": [1, 2, 3], "rest_taken.leds": [1, 2, 3]}
    run("calibrate", calibrated, changes=taken, **images_of(rig))
    given = {"capture": rig / "sphere_film", "calibration": calibrated}
    found = run("reconstruct", changes=three, **given)["metrics"]
    assert found["rmse_px"] < 0.3


def test_the_ball_alone_calibrates(raytraced: Raytraced, tmp_path: Path) -> None:
    """Without a flat frame the fall-off is modelled; vignetting and dirt stay."""
    rig = raytraced / "near33"
    calibrated = tmp_path / "ball.npz"
    without_flat = {name: v for name, v in images_of(rig).items() if name != "flat"}
    run("calibrate", calibrated, **without_flat)
    given = {"capture": rig / "sphere_film", "calibration": calibrated}
    assert run("reconstruct", **given)["metrics"]["rmse_px"] < 1.0


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "paper", "paper_no_shadow"])
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_both_back_ends_find_the_same_height(
    reconstruct: Reconstruct, rig: str, graph: str
) -> None:
    host = reconstruct(graph, rig, "cat_film", "numpy")
    device = reconstruct(graph, rig, "cat_film", "opencl")
    assert not device.plan.fallbacks
    apart = np.abs(host["height"] - device["height"]) / RIG_PIXEL_MM[rig]
    flipped = np.abs(host["slope"] - device["slope"]).max(axis=0) > 1e-3
    assert flipped.mean() < 1e-3
    assert apart[~flipped].max() < 0.01


def test_a_touch_leaves_every_file_of_the_contract(
    reconstruct: Reconstruct, tmp_path: Path
) -> None:
    result = reconstruct("paper", "far28", "sphere", out=tmp_path)
    names = {file.name for file in tmp_path.iterdir()}
    assert {
        "height.npy",
        "height.tiff",
        "height.ply",
        "height.png",
        "shadow.png",
        "shadow_view.png",
        "result.json",
    } == names
    assert np.array_equal(np.load(tmp_path / "height.npy"), result["height"])
