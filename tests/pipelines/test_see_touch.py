"""A calibrated sensor forwards: its images of a known height, and the height from its images."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tactograph.graph import load
from tactograph.nodes import BAND_DEVIATIONS, F4
from tests.fixtures import RIG_PIXEL_MM, Calibration, Raytraced


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_the_images_are_those_of_an_independent_renderer(
    rig: str, raytraced: Raytraced, calibration: Calibration
) -> None:
    """Except for the noise, which both have, and the rounding."""
    capture = raytraced / rig / "cat_film"
    truth = capture / "truth_height_mm.npy"
    see = load("see_touch", calibration=calibration(rig), height=truth, outputs=["image"])
    (rendered,) = see.items()
    files = [capture / f"led{k}.png" for k in range(1, 5)]
    images = np.array([cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files], np.float32)
    off = 255 * rendered["image"] - images
    assert np.sqrt(np.mean(off**2)) < 1.5
    assert np.abs(off.mean(axis=(1, 2), where=np.load(truth) > 0.02)).max() < 0.5


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_the_height_is_restored_within_its_stated_error(
    rig: str, raytraced: Raytraced, calibration: Calibration
) -> None:
    """Arrays alone: a press, twice with other noise, and the film at rest."""
    truth = np.load(raytraced / rig / "cat_film" / "truth_height_mm.npy")
    see = load("see_touch", calibration=calibration(rig))
    precise = load("precise", calibration=calibration(rig))
    errors, bands = [], []
    for height in (truth, truth, 0 * truth):
        images = see(height=height)["image"]
        assert images.shape == (4, *truth.shape)
        back = precise(frames=images)
        errors.append(np.abs(back["height"] - height))
        bands.append(BAND_DEVIATIONS * back["error"])
    assert np.sqrt(np.mean(errors[0] ** 2)) < 0.15 * RIG_PIXEL_MM[rig]
    touched = truth > 0.02
    # The light follows the calibration exactly, so its stated errors are absent.
    assert 0.9 < np.mean((np.array(errors) <= bands)[:2, touched]) < 0.99
    assert errors[2].max() < 1e-3


def test_a_seed_gives_the_same_noise_from_a_start_and_another_in_every_image(
    truth: F4, calibration: Calibration
) -> None:

    def images(seed: int | None) -> tuple[F4, F4]:
        see = load("see_touch", calibration=calibration("near33"), seed=seed)
        first, second = (see(height=0 * truth)["image"].copy() for _ in range(2))
        return first, second

    first, second = images(3)
    assert (first != second).any()
    np.testing.assert_array_equal(images(3), [first, second])
    assert (images(4)[0] != first).any()
    np.testing.assert_array_equal(*images(None))


@pytest.fixture
def truth(raytraced: Raytraced) -> F4:
    """The height of a soft press on `near33`."""
    return np.asarray(np.load(raytraced / "near33" / "cat_film" / "truth_height_mm.npy"))


@pytest.fixture
def altered(calibration: Calibration, tmp_path: Path) -> Callable[..., Path]:
    """The calibration of `near33` with some arrays replaced."""

    def write(**arrays: Any) -> Path:
        with np.load(calibration("near33"), allow_pickle=False) as read:
            stored = {**read, **{name: np.float32(array) for name, array in arrays.items()}}
        np.savez(tmp_path / "altered.npz", **stored)
        return tmp_path / "altered.npz"

    return write


def test_a_lens_bends_the_even_grid(truth: F4, altered: Callable[..., Path]) -> None:
    """The height is restored on the camera's pixels, as `see_touch` gives it there."""
    bent = altered(lens=[-0.1, 0, 0, 0, 0, 0, 0, 0])
    rendered = load("see_touch", calibration=bent)(height=truth)
    back = load("reconstruct", calibration=bent)(frames=rendered["image"])["height"]
    off, from_even = (np.sqrt(np.mean((back - z) ** 2)) for z in (rendered["height"], truth))
    assert off < 0.15 * RIG_PIXEL_MM["near33"]
    assert from_even > 3 * off


@pytest.mark.parametrize(
    "kind",
    [{"camera": 1 / 65}, {"albedo": 0.7}, {"albedo": 0.7, "refraction": 1.5}],
    ids=["the pupil 65 mm above the film", "a film with interreflection", "under a coat"],
)
def test_the_height_is_restored(
    kind: dict[str, float], truth: F4, altered: Callable[..., Path]
) -> None:
    """`precise` finds it as under a distant camera and on a matt film without interreflection."""
    file = altered(**kind)
    images = load("see_touch", calibration=file, seed=None)(height=truth)["image"]
    back = load("precise", calibration=file, outputs=["height"])(frames=images)
    assert np.sqrt(np.mean((back["height"] - truth) ** 2)) < 0.025 * RIG_PIXEL_MM["near33"]
