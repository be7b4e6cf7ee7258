"""A film with markers is calibrated and measured as one without, and its markers are followed."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.rings.mechanics.nodes.marker.find_markers import find_markers
from tactograph.rings.mechanics.nodes.marker.marker_darkness import marker_darkness
from tests.fixtures import MadeOnce
from tests.pipelines.conftest import Image, changed, run

PIXEL_MM = 1 / 7
SIZE = {"width_px": 160, "height_px": 120, "pixel_size_mm": PIXEL_MM, "seed": 1}
PRINT = {"pitch_mm": 2.0, "marker_mm": 0.25}
TOUCH = {"radius_mm": 5.0, "rise_mm": 1.5}
DRAG_MM = 1.0

AMBIENT = 0.125


@pytest.fixture
def sensor(made_once: MadeOnce) -> Path:
    """Captures and a calibration of a film without markers, and of one with them."""

    def make(folder: Path) -> None:
        plain, printed = folder / "plain", folder / "printed"
        run("simulate_flat", plain / "flat", **SIZE)
        run("simulate_press", plain / "ball", radius_mm=7.0, **SIZE)
        run("simulate_press", plain / "touch", **TOUCH, **SIZE)
        run("simulate_markers_flat", printed / "flat", **PRINT, **SIZE)
        run("simulate_markers", printed / "ball", radius_mm=7.0, **PRINT, **SIZE)
        run("simulate_markers", printed / "touch", drag_x_mm=DRAG_MM, **TOUCH, **PRINT, **SIZE)
        for film, graph in ((plain, "calibrate"), (printed, "calibrate_markers")):
            arguments = {"capture": film / "ball", "flat": film / "flat", "ball_radius_mm": 7.0}
            run(graph, film / "cal.npz", ranked=False, pixel_size_mm=PIXEL_MM, **arguments)

    return made_once("marker_sensor", make)


@pytest.mark.slow
def test_marked_markers_cost_little_height_and_move_with_the_film(
    sensor: Path, tmp_path: Path
) -> None:
    error, out = [], tmp_path / "markers"
    for film, ending in (("plain", ""), ("printed", ""), ("printed", "_markers")):
        captured = {"capture": sensor / film / "touch", "calibration": sensor / film / "cal.npz"}
        error.append(run(f"reconstruct{ending}", out, **captured)["metrics"]["rmse_px"])
    plain, unmarked, marked = error
    assert marked <= 1.3 * plain
    assert unmarked > 3 * marked
    table = np.genfromtxt(out / "markers.csv", delimiter=",", names=True)
    assert table["visible"].mean() >= 0.95
    assert table["dx_mm"].max() == pytest.approx(DRAG_MM, abs=0.05)
    assert np.abs(table["dy_mm"]).max() < 0.05
    assert cv2.imread(str(out / "markers.png")).shape[:2] == (480, 640)


def in_daylight(image: Image) -> Image:
    """An eighth of full scale more light."""
    return cv2.add(image, np.full_like(image, round(AMBIENT * np.iinfo(image.dtype).max)))


@pytest.mark.slow
def test_daylight_is_taken_off_a_flat_frame_not_its_markers(sensor: Path, tmp_path: Path) -> None:
    printed = sensor / "printed"
    capture, flat = (changed(printed / n, tmp_path / n, in_daylight) for n in ("ball", "flat"))
    known = {"ball_radius_mm": 7.0, "pixel_size_mm": PIXEL_MM}
    run("calibrate_markers", tmp_path / "cal.npz", capture=capture, flat=flat, **known)
    dull, lit = (read_calibration(file=folder / "cal.npz") for folder in (printed, tmp_path))
    assert np.median(lit.dark) == pytest.approx(AMBIENT, abs=0.01)
    assert np.abs(lit.flat - dull.flat).mean() < 0.01
    assert len(find_markers(marker_darkness(lit.flat), dark=0.08)) > 40
