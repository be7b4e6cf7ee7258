"""After a gel change a flat frame and one press are worth a full calibration."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tests.conftest import MadeOnce
from tests.nodes.gels import FLASHED, ONE_SHOT, PIXEL_MM, Gel, ball, save
from tests.pipelines.test_accuracy import run

RADIUS_MM = 4.0
TOUCH = ball(-3, 2, 5, 0.8)
CHANGED = {"thicker": 0.3, "albedo": 0.55, "alpha": 0.27, "dent": 0.05}
"""Of the new gel."""
SPOTS = {
    "flashed": [(0, 0), (-5, -3), (5, 3)],
    "oneshot": [(x, y) for y in (-5, 0, 5) for x in (-7, -2.4, 2.4, 7)],
}
LIGHTS = {"flashed": FLASHED, "oneshot": ONE_SHOT}
DEPTH_MM = {"flashed": 1.2, "oneshot": 0.6}
FULL = {"flashed": "calibrate", "oneshot": "calibrate_presses"}
AGAIN = {"flashed": "recalibrate", "oneshot": "recalibrate_oneshot"}
MEASURE = {"flashed": "reconstruct", "oneshot": "gelsight_mini"}
KINDS = tuple(SPOTS)


def take(folder: Path, kind: str, gel: Gel, presses: list[tuple[float, float]]) -> None:
    """Captures of a gel: untouched, a check press, a touch, and presses to calibrate with."""
    colour, depth = kind == "oneshot", DEPTH_MM[kind]
    save(folder / "flat", gel.seen(), colour)
    save(folder / "check", gel.seen(ball(0.5, 0.3, RADIUS_MM, depth)), colour)
    touch = save(folder / "touch", gel.seen(TOUCH), colour)
    np.save(touch / "truth_height_mm.npy", gel.height(TOUCH) - gel.dent)
    for number, (x, y) in enumerate(presses):
        save(folder / "presses" / f"{number:02}", gel.seen(ball(x, y, RADIUS_MM, depth)), colour)


@pytest.fixture
def captures(made_once: MadeOnce) -> Path:
    """An old and a new gel of both kinds of sensor."""

    def make(folder: Path) -> None:
        for kind in KINDS:
            take(folder / kind / "old", kind, Gel(LIGHTS[kind]), SPOTS[kind])
            take(folder / kind / "new", kind, Gel(LIGHTS[kind], 2, **CHANGED), [])

    return made_once("gels", make)


@pytest.fixture
def calibrations(captures: Path, made_once: MadeOnce) -> Path:
    """By kind: ``old.npz``, a full calibration, and ``new.npz``, recalibrated."""

    def make(folder: Path) -> None:
        for kind in KINDS:
            old, new = captures / kind / "old", captures / kind / "new"
            pressed = "capture" if kind == "flashed" else "captures"
            ball_of = {"ball_radius_mm": RADIUS_MM}
            full = {pressed: old / "presses", "flat": old / "flat", "pixel_size_mm": PIXEL_MM}
            before = folder / kind / "old.npz"
            before.parent.mkdir(parents=True)
            run(FULL[kind], before, **full, **ball_of)
            again = {"calibration": before, "flat": new / "flat", "capture": new / "check"}
            run(AGAIN[kind], before.with_name("new.npz"), **again, **ball_of)

    return made_once("gel_calibrations", make)


def microns(kind: str, gel: Path, calibration: Path, out: Path) -> float:
    found = run(MEASURE[kind], out, capture=gel / "touch", calibration=calibration)
    return 1e3 * PIXEL_MM * float(found["metrics"]["rmse_px"])


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_gel_is_measured_as_the_old_one_was(
    kind: str, captures: Path, calibrations: Path, tmp_path: Path
) -> None:
    """Another albedo and gloss, 0.3 mm thicker, and with a dent that stays."""
    old, new = captures / kind / "old", captures / kind / "new"
    full = microns(kind, old, calibrations / kind / "old.npz", tmp_path)
    again = microns(kind, new, calibrations / kind / "new.npz", tmp_path)
    assert again < 1.5 * full


@pytest.mark.parametrize("kind", KINDS)
def test_it_says_what_is_left_and_that_a_dent_stays(kind: str, calibrations: Path) -> None:
    about = np.load(calibrations / kind / "new.npz")["about"]
    quality = json.loads(str(about))["quality"]
    assert quality["check_deg/held_out"] < quality["check_deg/before"]
    assert quality["dent_um"] == pytest.approx(1e3 * CHANGED["dent"], rel=0.5)


def test_without_a_check_press_only_the_flat_frame_is_new(
    captures: Path, calibrations: Path, tmp_path: Path
) -> None:
    old, out = calibrations / "flashed" / "old.npz", tmp_path / "flat_only.npz"
    found = run("recalibrate", out, calibration=old, flat=captures / "flashed" / "new" / "flat")
    assert "press a ball" in found["advice"]
    before, after = np.load(old), np.load(out)
    assert not np.array_equal(before["flat"], after["flat"])
    for name in ("lights", "diffuse", "roughness", "albedo", "misfit"):
        np.testing.assert_array_equal(before[name], after[name])


def test_a_calibration_of_the_other_kind_says_which_graph_takes_it(
    captures: Path, calibrations: Path, tmp_path: Path
) -> None:
    flat = captures / "flashed" / "new" / "flat"
    with pytest.raises(InputError, match="recalibrate_oneshot"):
        run(
            "recalibrate",
            tmp_path / "x.npz",
            flat=flat,
            calibration=calibrations / "oneshot/old.npz",
        )


@pytest.mark.parametrize("kind", KINDS)
def test_a_calibration_is_right_for_its_own_film_and_not_for_another(
    kind: str, captures: Path, calibrations: Path, tmp_path: Path
) -> None:
    graph = {"flashed": "check_calibration", "oneshot": "check_calibration_oneshot"}[kind]
    old = calibrations / kind / "old.npz"
    seen = {
        gel: run(
            graph, tmp_path / "check.png", calibration=old, capture=captures / kind / gel / "flat"
        )
        for gel in ("old", "new")
    }
    assert seen["old"]["quality"]["wrong"] == 0
    assert "dent" in seen["new"]["film"]
    assert (tmp_path / "check.png").is_file()
