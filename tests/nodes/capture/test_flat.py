"""Dividing by the untouched film removes uneven light; that film may be read or estimated."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.capture.read_flat import read_flat
from tactograph.nodes.light.estimate_flat import estimate_flat
from tactograph.nodes.light.flat_field import flat_field
from tests.nodes.scenes import lambert

Y, X = np.mgrid[:60, :80] / 80
UNEVEN = np.stack([0.5 + 0.3 * X, 0.8 - 0.4 * Y, 0.4 + 0.2 * X * Y, 0.6 - 0.2 * X**2]).astype(
    np.float32
)
DARK = np.zeros((60, 80), np.float32)


def write(folder: Path, images: np.ndarray) -> Path:
    folder.mkdir()
    for k, image in enumerate(images, start=1):
        cv2.imwrite(str(folder / f"led{k}.png"), np.rint(image * 65535).astype(np.uint16))
    return folder


def test_the_film_at_rest_is_one_everywhere_and_the_dark_level_is_subtracted() -> None:
    assert np.allclose(flat_field(UNEVEN, UNEVEN, DARK), 1)
    dark, nothing = DARK + np.float32(0.05), np.zeros_like(UNEVEN)
    assert np.allclose(flat_field(UNEVEN + dark, UNEVEN, dark), 1, atol=1e-6)
    black_corners = flat_field(nothing + np.float32(0.001), nothing, DARK, floor=0.02)
    assert black_corners.max() < 0.06, "they are not amplified"


def test_the_untouched_film_is_read_and_its_noise_smoothed(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).normal(0, 0.01, UNEVEN.shape)
    folder = write(tmp_path / "flat", UNEVEN + noise)
    flat = read_flat(UNEVEN, folder=folder, smooth_px=3.0).flat
    assert np.abs(flat - UNEVEN)[:, 8:-8, 8:-8].max() < 0.006


def test_smoothing_keeps_vignetting_up_to_the_border(tmp_path: Path) -> None:
    """A Gaussian alone made every flat frame 0.0003 too dark, and touched film a dome of 1 um."""
    vignetting = 0.8 - 0.5 * (X - 0.5) ** 2 - 0.4 * (Y - 0.4) ** 2
    folder = write(tmp_path / "flat", np.broadcast_to(vignetting, UNEVEN.shape))
    flat = read_flat(UNEVEN, folder=folder, smooth_px=3.0).flat
    assert np.abs(flat - vignetting).max() < 1e-5


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
@pytest.mark.parametrize("inside", ["", "first"])
def test_the_dark_image_has_the_depth_of_the_untouched_film(
    tmp_path: Path, depth: type, inside: str
) -> None:
    """Of 12 bits in 16 it was taken as 16 times darker than it is; its own 8 bits count."""
    film = write(tmp_path / "flat", UNEVEN)
    if inside:
        film.rename(tmp_path / inside)
        film.mkdir()
        film = (tmp_path / inside).rename(film / inside)
    for file in film.glob("led*.png"):
        cv2.imwrite(str(file), cv2.imread(str(file), cv2.IMREAD_UNCHANGED) // 16)
    (film / "capture.yaml").write_text("bits: 12\n")
    full = 255 if depth == np.uint8 else 4095
    file = tmp_path / "dark.png"
    cv2.imwrite(str(file), np.rint((DARK + 0.1) * full).astype(depth))
    dark = read_flat(UNEVEN, folder=tmp_path / "flat", dark=file).dark
    assert np.allclose(dark, 0.1, atol=0.003)


def test_without_a_flat_frame_the_light_is_uniform_and_a_warning_says_so() -> None:
    with collect_warnings([]) as notes:
        flat = read_flat(UNEVEN)
    assert (flat.flat == 1).all()
    assert "no flat frame was given" in notes[0]


def test_a_flat_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    folder = write(tmp_path / "flat", UNEVEN[:, :50])
    with pytest.raises(InputError, match="4 lights of 80 x 50 pixels, but the capture is 4 lights"):
        read_flat(UNEVEN, folder=folder)


def test_a_dark_image_with_an_led_on_is_refused(tmp_path: Path) -> None:
    folder = write(tmp_path / "flat", UNEVEN)
    with pytest.raises(InputError, match=r"under LED 2 the film is no brighter than .*led2\.png"):
        read_flat(UNEVEN, folder=folder, dark=folder / "led2.png")


def test_uneven_light_is_estimated_around_a_touch() -> None:
    slope = np.zeros((2, 60, 80), np.float32)
    slope[0, 20:40, 30:40], slope[0, 20:40, 40:50] = 0.5, -0.5
    touched = UNEVEN * lambert(slope) / lambert(0 * slope)
    assert np.abs(estimate_flat(touched) / UNEVEN - 1).max() < 0.01


def test_a_dark_image_has_the_depth_that_its_capture_states(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "dark.png"), np.full((4, 5), 409, np.uint16))
    (tmp_path / "capture.yaml").write_text("bits: 12\n")
    result = read_flat(np.ones((4, 4, 5), np.float32), dark=tmp_path / "dark.png")
    assert np.allclose(result.dark, 409 / 4095)
