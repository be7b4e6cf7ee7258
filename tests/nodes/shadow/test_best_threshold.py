"""The best threshold of the paper's test, on tables whose shadows are known."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.shadow.best_threshold import best_threshold

NULL = np.float32([0.5, -0.5, 0.5, -0.5])
LIGHTS = np.float32([[20, 0, 40], [0, 20, 40], [-20, 0, 40], [0, -20, 40]])
ALL = np.full(1000, 15, np.uint8)


def table(spread: float, lost: float) -> tuple[np.ndarray, np.ndarray]:
    """Light and slopes: 900 pixels that all LEDs reach, and 100 that turn away from LED 2."""
    rng = np.random.default_rng(1)
    light = 1 + rng.normal(0, spread, (1000, 4))
    slope = rng.uniform(-1.2, 1.2, (1000, 2))
    slope[:100, 1] = 2.2
    light[:100, 1] -= lost * np.linspace(0.5, 1, 100)
    return light.astype(np.float32), slope.astype(np.float32)


def test_the_best_threshold_lies_between_noise_and_shadow() -> None:
    light, slope = table(0.01, 0.8)
    best = best_threshold(light, ALL, slope, LIGHTS, NULL)
    assert 0.04 < best < 0.2
    black = np.where(slope[:, 1] > 2, 0b1101, ALL).astype(np.uint8)
    assert best_threshold(light, black, slope / 3, LIGHTS, NULL) == best


def test_noise_that_hides_shadows_makes_the_threshold_a_compromise() -> None:
    light, slope = table(0.1, 0.5)
    best, departure = best_threshold(light, ALL, slope, LIGHTS, NULL), np.abs(light @ NULL)
    shadowed = slope[:, 1] > 2

    def above_chance(threshold: float) -> float:
        above = departure > threshold
        return float(above[shadowed].mean() - above[~shadowed].mean())

    assert above_chance(best) >= max(map(above_chance, np.linspace(0, 0.5, 500)))


def test_a_press_without_shadows_has_no_best_threshold() -> None:
    light, slope = table(0.01, 0.0)
    with pytest.raises(InputError, match="0 of the calibration"):
        best_threshold(light, ALL, slope / 3, LIGHTS, NULL)
