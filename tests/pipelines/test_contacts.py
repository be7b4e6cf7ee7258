"""A shipped graph says of a simulated touch where it is and how deep; of none, none."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.conftest import without_pictures

PIXEL = 0.2
SIZE = {"width_px": 96, "height_px": 72, "pixel_size_mm": PIXEL}


def run(graph: str, changes: dict[str, object] | None = None, **given: object) -> None:
    changed = with_changes(without_pictures(read_graph(graph)), changes or {})
    for _ in open_pipeline(changed, given).items():
        pass


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibrated sensor, a touch and the untouched film at another time."""
    folder = tmp_path_factory.mktemp("sensor")
    run("simulate", radius_mm=5.0, seed=1, out=str(folder / "ball"), **SIZE)
    run("simulate_flat", seed=2, out=str(folder / "flat"), **SIZE)
    run("simulate_flat", seed=5, out=str(folder / "untouched"), **SIZE)
    run("simulate_press", radius_mm=4.0, seed=3, out=str(folder / "touch"), **SIZE)
    run(
        "calibrate",
        capture=str(folder / "ball"),
        flat=str(folder / "flat"),
        ball_radius_mm=5.0,
        pixel_size_mm=PIXEL,
        out=str(folder / "cal.npz"),
    )
    return folder


def test_a_touch_is_measured_in_its_result(sensor: Path) -> None:
    out = sensor / "touched"
    run(
        "reconstruct",
        capture=str(sensor / "touch"),
        calibration=str(sensor / "cal.npz"),
        out=str(out),
    )
    figures = json.loads((out / "result.json").read_text())["metrics"]
    numbers = cv2.imread(str(out / "contact.png"), cv2.IMREAD_UNCHANGED)
    height = np.load(out / "height.npy")
    assert figures["contacts"] == 1
    assert figures["contact_area_mm2/c1"] == pytest.approx((numbers == 1).sum() * PIXEL**2)
    assert figures["contact_depth_mm/c1"] == pytest.approx(height.max())
    assert figures["contact_x_mm/c1"] == pytest.approx(0, abs=0.3)
    assert figures["contact_y_mm/c1"] == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize("graph", ["reconstruct", "precise"])
@pytest.mark.parametrize("offset", [(-11.0, 0.0), (9.6, 7.2)])
def test_what_is_seen_of_a_ball_that_the_border_cuts_is_as_high_as_it_is(
    sensor: Path, graph: str, offset: tuple[float, float]
) -> None:
    touch, out = sensor / f"at {offset}", sensor / f"cut {offset} {graph}"
    run("simulate_press", {"shape.offset_mm": list(offset)}, radius_mm=4.0, out=str(touch), **SIZE)
    run(graph, capture=str(touch), calibration=str(sensor / "cal.npz"), out=str(out))
    figures = json.loads((out / "result.json").read_text())["metrics"]
    truth = np.load(touch / "truth_height_mm.npy")
    assert figures["contact_cut/c1"] is True
    assert figures["contact_depth_mm/c1"] == pytest.approx(truth.max(), rel=0.005)


def test_the_untouched_film_has_no_contact(sensor: Path) -> None:
    out = sensor / "free"
    run(
        "reconstruct",
        capture=str(sensor / "untouched"),
        calibration=str(sensor / "cal.npz"),
        out=str(out),
    )
    assert json.loads((out / "result.json").read_text())["metrics"]["contacts"] == 0
    assert not cv2.imread(str(out / "contact.png"), cv2.IMREAD_UNCHANGED).any()
