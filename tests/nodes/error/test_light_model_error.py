"""The stated error of a height by a light model: it grows with what the model does not explain."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.nodes import BAND_DEVIATIONS, F4
from tactograph.nodes.scan.read_light_model import read_light_model
from tests.nodes.scan.scans import cap, seen, write_model


def states(folder: Path, noise: float, wrong: float, seed: int) -> tuple[F4, F4]:
    """The error of the height of a cap, and what is stated; LEDs wrong each in its own way."""
    write_model(folder / "model.yaml")
    z = cap(radius=0.9, depth=0.06)
    light = seen(z, read_light_model(file=folder / "model.yaml").model)
    rng = np.random.default_rng(seed)
    light *= 1 + rng.normal(0, noise, light.shape)
    light *= 1 + rng.normal(0, wrong, (len(light), 1, 1))
    found = load(
        "reconstruct_scan", model=folder / "model.yaml", backend="numpy", level="rest", cell_px=4
    )(frames=light.astype(np.float32))
    off = found["height"] - z
    return off - off[0].mean(), found["error"]


def test_noise_stays_in_its_band(tmp_path: Path) -> None:
    found = [states(tmp_path, 0.01, 0.0, seed) for seed in range(8)]
    inside = [(np.abs(off) < BAND_DEVIATIONS * error).mean() for off, error in found]
    assert 0.8 < np.mean(inside) < 0.98


def test_light_that_no_slope_explains_widens_the_error(tmp_path: Path) -> None:
    right, wrong = (states(tmp_path, 0.01, by, 3)[1] for by in (0.0, 0.03))
    assert np.median(wrong) > 3 * np.median(right)


def test_twice_the_noise_is_twice_the_error(tmp_path: Path) -> None:
    once, twice = (np.median(states(tmp_path, noise, 0.0, 5)[1]) for noise in (0.01, 0.02))
    assert twice / once == pytest.approx(2, rel=0.3)
