"""Film that does not fill the frame: round views, housings, black frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_flat import shape_flat

PIXEL_MM, BALL_MM = 0.1, 4.0
CANVAS = {"width_px": 160, "height_px": 120, "pixel_size_mm": PIXEL_MM}
ROWS, COLUMNS = np.mgrid[:120, :160]
VIEWS = {
    "all film": np.ones((120, 160), bool),
    "a round view": np.hypot(COLUMNS - 79.5, ROWS - 59.5) < 58,
    "a black frame": np.pad(np.ones((84, 136), bool), ((18, 18), (12, 12))),
}
Image = NDArray[np.uint8]


def taken(object_mm: F4, seen: NDArray[np.bool_], seed: int) -> Image:
    """What the camera sees: film in one part of the frame, and black housing in the other."""
    lights = light_ring(count=4, slant_deg=40.0, distance_mm=40.0, first_azimuth_deg=45.0)
    counts = 255 * expose(render(object_mm, PIXEL_MM, lights).light, seed=seed).image
    housing = np.random.default_rng(seed).normal(2, 0.6, counts.shape)
    return np.clip(np.rint(np.where(seen, counts, housing)), 0, 255).astype(np.uint8)


def write(folder: Path, images: Image) -> str:
    folder.mkdir()
    for k, image in enumerate(images, start=1):
        cv2.imwrite(str(folder / f"led{k}.png"), image)
    return str(folder)


TOUCH = shape_ball(radius_mm=5.0, rise_mm=0.8, offset_mm=(0.6, -0.4), **CANVAS).height


@pytest.fixture(scope="module", params=VIEWS)
def view(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with captures and a calibration."""
    folder, seen = tmp_path_factory.mktemp("view"), VIEWS[request.param]
    ball = shape_ball(radius_mm=BALL_MM, rise_mm=1.2, **CANVAS).height
    made = {"flat": shape_flat(**CANVAS).height, "ball": ball, "touch": TOUCH}
    for seed, (name, height) in enumerate(made.items()):
        write(folder / name, taken(height, seen, seed))
    np.save(folder / "seen.npy", seen)
    given = {"capture": str(folder / "ball"), "flat": str(folder / "flat")}
    scale = {"ball_radius_mm": BALL_MM, "pixel_size_mm": PIXEL_MM}
    (result,) = open_pipeline(
        read_graph("calibrate"), {**given, **scale, "out": str(folder / "cal.npz")}
    ).items()
    said = [line for line in result.warnings if "fills" in line]
    assert bool(said) == (not seen.all())
    assert not [line for line in result.warnings if line not in said and "OpenCL" not in line]
    return folder


@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_what_is_no_film_changes_no_height(view: Path, graph: str) -> None:
    given = {"capture": str(view / "touch"), "calibration": str(view / "cal.npz")}
    (result,) = open_pipeline(read_graph(graph), given, sinks=False).items()
    seen = np.load(view / "seen.npy")
    off = (result["height"] - TOUCH)[seen]
    assert np.sqrt(np.mean(off**2)) < (0.03 if graph == "paper" else 0.012)
    assert np.abs(result["height"][~seen]).max(initial=0) < 0.05
    assert not [line for line in result.warnings if "may be wrong" in line]
