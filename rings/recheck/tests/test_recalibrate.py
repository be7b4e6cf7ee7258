"""After a gel change a flat frame and one press are worth a full calibration."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph.run.open_pipeline import open_pipeline
from tests.fixtures import MadeOnce
from tests.nodes.gels import PIXEL_MM, Gel, ball, save
from tests.pipelines.conftest import run

RADIUS_MM = 4.0
TOUCH = ball(-3, 2, 5, 0.8)
CHANGED = {"thicker": 0.3, "albedo": 0.55, "alpha": 0.27, "dent": 0.05}
"""Of the new gel."""
SPOTS = [(0, 0), (-5, -3), (5, 3)]


def take(folder: Path, gel: Gel, presses: list[tuple[float, float]]) -> None:
    """Captures of a gel: untouched, a check press, a touch, and presses to calibrate with."""
    save(folder / "flat", gel.seen())
    save(folder / "check", gel.seen(ball(0.5, 0.3, RADIUS_MM, 1.2)))
    touch = save(folder / "touch", gel.seen(TOUCH))
    np.save(touch / "truth_height_mm.npy", gel.height(TOUCH) - gel.dent)
    for number, (x, y) in enumerate(presses):
        save(folder / "presses" / f"{number}", gel.seen(ball(x, y, RADIUS_MM, 1.2)))


@pytest.fixture
def gels(made_once: MadeOnce) -> Path:
    """An old gel with a full calibration, and a new one that is recalibrated from it."""

    def make(folder: Path) -> None:
        old, new = folder / "old", folder / "new"
        take(old, Gel(), SPOTS)
        take(new, Gel(seed=2, **CHANGED), [])
        arguments = {"capture": old / "presses", "flat": old / "flat", "pixel_size_mm": PIXEL_MM}
        run("calibrate", old / "cal.npz", ball_radius_mm=RADIUS_MM, **arguments)
        again = {"calibration": old / "cal.npz", "capture": new / "check", "flat": new / "flat"}
        run("recalibrate", new / "cal.npz", ball_radius_mm=RADIUS_MM, **again)

    return made_once("gels", make)


def microns(gel: Path, out: Path) -> float:
    found = run("reconstruct", out, capture=gel / "touch", calibration=gel / "cal.npz")
    return 1e3 * PIXEL_MM * float(found["metrics"]["rmse_px"])


@pytest.mark.slow
def test_a_new_gel_is_measured_as_the_old_one_was(gels: Path, tmp_path: Path) -> None:
    """Another albedo and gloss, 0.3 mm thicker, and with a dent that stays."""
    assert microns(gels / "new", tmp_path) < 1.5 * microns(gels / "old", tmp_path)


@pytest.mark.slow
def test_recalibration_reports_its_residual_and_that_a_dent_stays(gels: Path) -> None:
    about = np.load(gels / "new" / "cal.npz")["about"]
    quality = json.loads(str(about))["quality"]
    assert quality["check_deg/held_out"] < 0.5 * quality["check_deg/before"]
    assert quality["dent_um"] == pytest.approx(1e3 * CHANGED["dent"], rel=0.5)


@pytest.mark.slow
def test_without_a_check_press_only_the_flat_frame_is_new(gels: Path, tmp_path: Path) -> None:
    old, out = gels / "old" / "cal.npz", tmp_path / "flat_only.npz"
    found = run("recalibrate", out, calibration=old, flat=gels / "new" / "flat")
    assert "presses of a ball" in found["advice"]
    before, after = np.load(old), np.load(out)
    assert not np.array_equal(before["flat"], after["flat"])
    for name in ("lights", "diffuse", "roughness", "albedo", "misfit"):
        np.testing.assert_array_equal(before[name], after[name])


@pytest.mark.slow
def test_a_calibration_is_right_for_its_own_film_alone(gels: Path, tmp_path: Path) -> None:
    old, out = gels / "old" / "cal.npz", tmp_path / "check.png"
    seen = {
        gel: run("check_calibration", calibration=old, capture=gels / gel / "flat")
        for gel in ("old", "new")
    }
    assert seen["old"]["quality"]["wrong"] == 0
    assert "dent" in seen["new"]["film"]
    arguments = {"calibration": old, "capture": gels / "new" / "flat", "out": out}
    list(open_pipeline("check_calibration", arguments).items())
    assert out.is_file()
