"""The images of a touch from a one-shot sensor's map of light."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import Provenance, load
from tactograph.rings.oneshot.nodes.file.write_press_calibration import write_press_calibration


@pytest.mark.filterwarnings("ignore:this touch is not checked")
def test_a_one_shot_sensor_forwards_and_back(tmp_path: Path) -> None:
    """From its map of light alone: a press and the film at rest."""
    rows, columns, pixel = 120, 160, 0.1
    reflectance = np.zeros((3, 9, 15), np.float32)
    reflectance[:, 0, 0], reflectance[:, 1, 0] = (0.6, -0.3, -0.3), (0, 0.5, -0.5)
    reflectance[:, 2, 0] = 0.8
    flat = np.full((3, rows, columns), 0.4, np.float32)
    file = tmp_path / "map.npz"
    none = Provenance({}, None, [], {}, {}, [], [])
    write_press_calibration(flat, pixel, reflectance, {}, "", file=file, provenance=none)
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    cap = np.sqrt(np.maximum(50**2 - (x - 80) ** 2 - (y - 60) ** 2, 0)) - 40
    z = np.asarray(np.maximum(cap * pixel, 0) * 0.5, np.float32)
    seen = load("see_touch_oneshot", calibration=file, bits=16, seed=None)(height=z)
    assert seen["image"].shape == (3, rows, columns)
    back = load("gelsight_mini", calibration=file)(frames=seen["image"])["height"]
    assert np.sqrt(np.mean((back - seen["height"]) ** 2)) < 0.1 * pixel
