"""What is wrong with a calibration is told, and blamed on what causes it."""

from __future__ import annotations

import numpy as np

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rate_calibration import rate_calibration
from tactograph.nodes.simulate.light_ring import light_ring

LIGHTS = light_ring(distance_mm=80.0)
GOOD, POOR = np.full(4, 0.01, np.float32), np.full(4, 0.06, np.float32)
SLOPES = np.stack([np.cos(np.arange(64)), np.sin(np.arange(64))], axis=1).astype(np.float32)
MASK = np.ones((4, 6), np.uint8)
FLAT = np.full((4, 4, 6), 0.5, np.float32)


def told(left: F4, lights: F4 = LIGHTS, noise: float = 0.0) -> list[str]:
    notes: list[str] = []
    variance = np.array([0, noise**2], np.float32)
    with collect_warnings(notes):
        rate_calibration(
            left, 0.01, SLOPES, MASK, 15 * MASK, lights, left, None, FLAT, variance
        )  # fmt: skip
    return notes


def test_a_good_calibration_has_no_warning() -> None:
    assert not told(GOOD)


def test_what_no_noise_explains_is_blamed_on_the_ball() -> None:
    notes = told(POOR, noise=0.001)
    assert len(notes) == 2
    assert all("ball's radius" in note for note in notes)


def test_noise_is_blamed_on_the_exposure() -> None:
    (note,) = told(POOR, noise=0.03)
    assert "expose longer" in note


def test_two_leds_in_one_place_are_named() -> None:
    lights = LIGHTS.copy()
    lights[3] = lights[1]
    (note,) = told(GOOD, lights)
    assert "LEDs 2 and 4" in note
