"""After a gel change a flat frame and one press are worth a full calibration."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.calibrate.file.press_calibration import PRESS_CALIBRATION
from tactograph.nodes.files.calibration_file import write_arrays
from tactograph.nodes.optics.reflectance_map import predicted, shades, terms
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
        given = {"capture": old / "presses", "flat": old / "flat", "pixel_size_mm": PIXEL_MM}
        run("calibrate", old / "cal.npz", ball_radius_mm=RADIUS_MM, **given)
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
def test_it_says_what_is_left_and_that_a_dent_stays(gels: Path) -> None:
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
    given = {"calibration": old, "capture": gels / "new" / "flat", "out": out}
    list(open_pipeline("check_calibration", given).items())
    assert out.is_file()


def one_shot_map(gains: tuple[float, float, float] = (1, 1, 1)) -> F4:
    """A map as LEDs beside the film make it: three directions, uneven over the film."""
    made = np.zeros((3, 9, 15), np.float32)
    for k, turn in enumerate(np.radians([-90, 30, 150])):
        made[k, 0, :3] = 1.2 * np.cos(turn), 0.3, 0.1
        made[k, 1, :3] = 1.2 * np.sin(turn), -0.1, 0.3
        made[k, 2, 0], made[k, 8, 0] = 0.7, 0.15
    return made * np.asarray(gains, np.float32)[:, None, None]


def one_shot(reflectance: F4, thing: F4) -> F4:
    """What such a sensor sees of a thing that stands in the film."""
    q, p = np.gradient(thing, PIXEL_MM)
    rows, columns = thing.shape
    y, x = (part.ravel().astype(float) for part in np.indices(thing.shape))
    shade = shades(np.stack([p.ravel(), q.ravel()]), thing.ravel())
    light = 1 + predicted(reflectance, shade, terms(x, y, (rows, columns)))
    return (0.5 * light.reshape(3, rows, columns)).clip(0, 1).astype(np.float32)


def test_a_one_shot_sensor_gets_the_gain_that_its_check_press_shows(tmp_path: Path) -> None:
    old, new = one_shot_map(), one_shot_map((0.8, 0.9, 0.85))
    level, pressed = np.zeros((90, 120), np.float32), wide_ball(2.0, 0.6)
    flat = save(tmp_path / "flat", one_shot(new, level), colour=True)
    check = save(tmp_path / "check", one_shot(new, pressed), colour=True)
    cal = tmp_path / "old.npz"
    arrays = {"flat": one_shot(old, level), "pixel_size": PIXEL_MM, "reflectance": old}
    write_arrays(cal, PRESS_CALIBRATION, arrays, {"quality": {"heldout_normal_deg": 1.0}})
    run(
        "recalibrate_oneshot", tmp_path / "new.npz",
        calibration=cal, flat=flat, capture=check, ball_radius_mm=2.0,
    )  # fmt: skip
    about = json.loads(str(np.load(tmp_path / "new.npz")["about"]))["quality"]
    found = [about[f"gain_percent/light{k}"] for k in (1, 2, 3)]
    assert found == pytest.approx([80, 90, 85], abs=4)
    assert about["check_deg/held_out"] < 0.5 * about["check_deg/before"]
    seen = run(
        "check_calibration_oneshot", tmp_path / "check.png", calibration=cal, capture=flat
    )["quality"]  # fmt: skip
    assert seen["wrong"] == 0


def wide_ball(radius: float, depth: float) -> F4:
    """A ball in the middle of a film of 90 x 120 pixels."""
    y, x = (np.indices((90, 120)) - np.array([44.5, 59.5])[:, None, None]) * PIXEL_MM
    below = np.sqrt(np.maximum(radius**2 - x * x - y * y, 0))
    return np.maximum(below - (radius - depth), 0).astype(np.float32)


def test_a_calibration_of_the_other_kind_says_which_graph_takes_it(tmp_path: Path) -> None:
    file = tmp_path / "mini.npz"
    flat = np.ones((3, 4, 5), np.float32)
    arrays = {"flat": flat, "pixel_size": PIXEL_MM, "reflectance": one_shot_map()}
    write_arrays(file, PRESS_CALIBRATION, arrays, {})
    with pytest.raises(InputError, match="recalibrate_oneshot"):
        run("recalibrate", tmp_path / "x.npz", flat=tmp_path, calibration=file)
