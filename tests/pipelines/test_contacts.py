"""A shipped graph measures the place and depth of a simulated touch, and finds none without."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.fixtures import simulated_sensor
from tests.pipelines.conftest import run

PIXEL = 0.2
SIZE = {"width_px": 96, "height_px": 72, "pixel_size_mm": PIXEL}


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibrated sensor, a touch and the untouched film at another time."""
    folder = simulated_sensor(tmp_path_factory.mktemp("sensor"), ranked=False, **SIZE)
    run("simulate_flat", folder / "untouched", seed=5, **SIZE)
    run("simulate_press", folder / "touch", radius_mm=4.0, seed=3, **SIZE)
    return folder


def test_a_touch_is_measured_in_its_result(sensor: Path) -> None:
    out = sensor / "touched"
    run("reconstruct", out, capture=sensor / "touch", calibration=sensor / "cal.npz")
    figures = json.loads((out / "result.json").read_text())["metrics"]
    numbers = cv2.imread(str(out / "contact.png"), cv2.IMREAD_UNCHANGED)
    height = np.load(out / "height.npy")
    assert figures["contacts"] == 1
    assert figures["contact_area_mm2/c1"] == pytest.approx((numbers == 1).sum() * PIXEL**2)
    assert figures["contact_depth_mm/c1"] == pytest.approx(height.max())
    assert figures["contact_x_mm/c1"] == pytest.approx(0, abs=0.3)
    assert figures["contact_y_mm/c1"] == pytest.approx(0, abs=0.3)


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "precise"])
@pytest.mark.parametrize("offset", [(-11.0, 0.0), (9.6, 7.2)])
def test_the_visible_part_of_a_ball_that_the_border_cuts_has_its_true_height(
    sensor: Path, graph: str, offset: tuple[float, float]
) -> None:
    touch, out = sensor / f"at {offset}", sensor / f"cut {offset} {graph}"
    moved = {"shape.offset_mm": list(offset)}
    run("simulate_press", touch, changes=moved, radius_mm=4.0, **SIZE)
    run(graph, out, capture=touch, calibration=sensor / "cal.npz")
    figures = json.loads((out / "result.json").read_text())["metrics"]
    truth = np.load(touch / "truth_height_mm.npy")
    assert figures["contact_cut/c1"] is True
    assert figures["contact_depth_mm/c1"] == pytest.approx(truth.max(), rel=0.005)


def test_the_untouched_film_has_no_contact(sensor: Path) -> None:
    out = sensor / "free"
    run("reconstruct", out, capture=sensor / "untouched", calibration=sensor / "cal.npz")
    assert json.loads((out / "result.json").read_text())["metrics"]["contacts"] == 0
    assert not cv2.imread(str(out / "contact.png"), cv2.IMREAD_UNCHANGED).any()
