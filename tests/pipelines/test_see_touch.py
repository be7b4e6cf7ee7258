"""A calibrated sensor forwards: its images of a known height, and the height from its images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import load
from tactograph.nodes import F4
from tests.conftest import RIG_PIXEL_MM, Calibration, Raytraced

COUNTS = 255


def images(capture: Path) -> F4:
    files = [capture / f"led{k}.png" for k in range(1, 5)]
    return np.array([cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files], np.float32)


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_an_independent_renderer_sees_the_same(
    rig: str, raytraced: Raytraced, calibration: Calibration
) -> None:
    """But for the noise, which both have, and the rounding."""
    capture = raytraced / rig / "cat_film"
    see = load(
        "see_touch",
        calibration=calibration(rig),
        height=capture / "truth_height_mm.npy",
        outputs=["image"],
    )
    (seen,) = see.items()
    off = COUNTS * seen["image"] - images(capture)
    assert np.sqrt(np.mean(off**2)) < 1.5
    touched = np.load(capture / "truth_height_mm.npy") > 0.02
    assert np.abs(off.mean(axis=(1, 2), where=touched)).max() < 0.5


def test_the_height_comes_back(
    tmp_path: Path, raytraced: Raytraced, calibration: Calibration
) -> None:
    cal, capture = calibration("near33"), raytraced / "near33" / "cat_film"
    truth = np.load(capture / "truth_height_mm.npy")
    see = load("see_touch", calibration=cal, height=capture / "truth_height_mm.npy")
    (seen,) = see.items()
    back = load("reconstruct", calibration=cal)(frames=seen["image"])
    assert np.sqrt(np.mean((back["height"] - truth) ** 2)) < 0.15 * RIG_PIXEL_MM["near33"]


def test_the_same_seed_gives_the_same_noise_and_none_gives_none(
    raytraced: Raytraced, calibration: Calibration
) -> None:
    flat = raytraced / "near33" / "cat_film" / "truth_height_mm.npy"

    def image(seed: int | None) -> F4:
        see = load("see_touch", calibration=calibration("near33"), height=flat, seed=seed)
        (seen,) = see.items()
        return np.asarray(seen["image"])

    np.testing.assert_array_equal(image(3), image(3))
    assert (image(3) != image(4)).any()
    np.testing.assert_array_equal(image(None), image(None))
