"""A one-shot sensor after a gel change, and which graph takes its calibration."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.rings.oneshot.nodes.file.press_calibration import PRESS_CALIBRATION
from tactograph.rings.oneshot.nodes.map.reflectance_map import predicted, shades, terms
from tests.nodes.gels import PIXEL_MM, save
from tests.pipelines.conftest import run


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
    PRESS_CALIBRATION.write(cal, arrays | {"quality": {"heldout_normal_deg": 1.0}})
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
    PRESS_CALIBRATION.write(file, arrays)
    with pytest.raises(InputError, match="recalibrate_oneshot"):
        run("recalibrate", tmp_path / "x.npz", flat=tmp_path, calibration=file)
