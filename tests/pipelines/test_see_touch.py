"""A calibrated sensor forwards: its images of a known height, and the height from its images."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import Provenance, load
from tactograph.nodes import BAND_DEVIATIONS, F4
from tactograph.nodes.calibrate.file.write_press_calibration import write_press_calibration
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


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_the_height_comes_back_within_its_stated_error(
    rig: str, raytraced: Raytraced, calibration: Calibration
) -> None:
    """Arrays alone: a press, twice with other noise, and the film at rest, as one batch."""
    truth = np.load(raytraced / rig / "cat_film" / "truth_height_mm.npy")
    heights = np.stack([truth, truth, 0 * truth])
    images = load("see_touch", calibration=calibration(rig))(height=heights)["image"]
    assert images.shape == (3, 4, *truth.shape)
    back = load("precise", calibration=calibration(rig))(frames=images)
    off = np.abs(back["height"] - heights)
    assert np.sqrt(np.mean(off[0] ** 2)) < 0.15 * RIG_PIXEL_MM[rig]
    band = BAND_DEVIATIONS * back["error"]
    touched = truth > 0.02
    assert np.mean((off <= band)[:2, touched]) > 0.88
    assert off[2].max() < 1e-3


def test_a_seed_gives_the_same_noise_from_a_start_and_another_in_every_image(
    raytraced: Raytraced, calibration: Calibration
) -> None:
    rest = np.zeros_like(np.load(raytraced / "near33" / "cat_film" / "truth_height_mm.npy"))

    def images(seed: int | None) -> F4:
        see = load("see_touch", calibration=calibration("near33"), seed=seed)
        return np.asarray(see(height=np.stack([rest, rest]))["image"])

    first, second = images(3)
    assert (first != second).any()
    np.testing.assert_array_equal(images(3), [first, second])
    assert (images(4)[0] != first).any()
    np.testing.assert_array_equal(*images(None))


def test_a_lens_shows_the_even_grid_as_the_camera_sees_it(
    raytraced: Raytraced, calibration: Calibration, tmp_path: Path
) -> None:
    """The height comes back on the camera's pixels, as `see_touch` gives it there."""
    with np.load(calibration("near33"), allow_pickle=False) as read:
        made = {**read, "lens": np.float32([-0.1, 0, 0, 0, 0, 0, 0, 0])}
    np.savez(tmp_path / "bent.npz", **made)
    truth = np.load(raytraced / "near33" / "cat_film" / "truth_height_mm.npy")
    seen = load("see_touch", calibration=tmp_path / "bent.npz")(height=truth)
    back = load("reconstruct", calibration=tmp_path / "bent.npz")(frames=seen["image"])["height"]
    off, apart = (np.sqrt(np.mean((back - z) ** 2)) for z in (seen["height"], truth))
    assert off < 0.15 * RIG_PIXEL_MM["near33"]
    assert apart > 3 * off


@pytest.mark.parametrize(
    "kind",
    [{"camera": 1 / 65}, {"albedo": 0.7}, {"albedo": 0.7, "refraction": 1.5}],
    ids=["the pupil 65 mm above the film", "a film that lights itself", "under a coat"],
)
def test_the_height_comes_back(
    kind: dict[str, float], raytraced: Raytraced, calibration: Calibration, tmp_path: Path
) -> None:
    """By `precise`, as under a distant camera from a matt film that throws no light on itself."""
    with np.load(calibration("near33"), allow_pickle=False) as read:
        np.savez(tmp_path / "kind.npz", **{**read, **{k: np.float32(v) for k, v in kind.items()}})
    truth = np.load(raytraced / "near33" / "cat_film" / "truth_height_mm.npy")
    images = load("see_touch", calibration=tmp_path / "kind.npz", seed=None)(height=truth)["image"]
    back = load("precise", calibration=tmp_path / "kind.npz", outputs=["height"])(frames=images)
    assert np.sqrt(np.mean((back["height"] - truth) ** 2)) < 0.02 * RIG_PIXEL_MM["near33"]


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
