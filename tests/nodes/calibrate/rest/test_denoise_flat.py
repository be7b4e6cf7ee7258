"""The flat frame keeps the detail that the presses show too, and no other."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.denoise_flat import denoise_flat

SIZE = 240, 320


def illumination() -> F4:
    """Two LEDs near the film."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    leds = ((-80.0, 120.0), (400.0, 60.0))
    return np.stack(
        [0.7 * (1 + ((x - a) ** 2 + (y - b) ** 2) / 300**2) ** -1.5 for a, b in leds]
    ).astype(np.float32)


def grain(rng: np.random.Generator) -> F4:
    return rng.normal(1, 0.02, (2, *SIZE)).astype(np.float32)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def test_grain_that_no_press_shows_is_removed(rng: np.random.Generator) -> None:
    light = illumination()
    flat = light * grain(rng)
    presses = np.concatenate([light * grain(rng), light * grain(rng)], axis=1)
    residual = denoise_flat(flat, presses) / light - 1
    assert residual.std() < 0.1 * (flat / light - 1).std()


def test_light_at_the_border_of_the_frame_is_not_distorted(rng: np.random.Generator) -> None:
    light = illumination()
    presses = light * grain(rng)
    residual = denoise_flat(light * grain(rng), presses) / light - 1
    border = np.concatenate(
        [residual[:, :8].ravel(), residual[:, -8:].ravel(), residual[:, :, :8].ravel()]
    )
    assert abs(border.mean()) < 5e-4


def test_texture_of_the_film_itself_stays(rng: np.random.Generator) -> None:
    texture = illumination() * grain(rng)
    flat, presses = texture * rng.normal(1, 0.004, texture.shape), texture
    denoised = denoise_flat(flat.astype(np.float32), presses)
    assert np.abs(np.log(denoised / texture)).std() < 0.006


@pytest.mark.parametrize("pressed", [True, False])
def test_dirt_stays_where_a_press_shows_it_too_and_is_removed_elsewhere(
    rng: np.random.Generator, pressed: bool
) -> None:
    clean, dirty = illumination(), illumination()
    dirty[:, 100:103, 150:153] *= 0.6
    shown = dirty if pressed else clean
    denoised = denoise_flat(dirty * grain(rng), shown * grain(rng))
    np.testing.assert_allclose(denoised[:, 101, 151], shown[:, 101, 151], rtol=0.1)


def test_a_press_itself_adds_no_detail(rng: np.random.Generator) -> None:
    light = illumination()
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    ball = np.hypot(x - 160, y - 120) < 60
    pressed = np.where(ball, light * (1 + (x - 160) / 90), light).astype(np.float32)
    residual = denoise_flat(light * grain(rng), pressed * grain(rng)) / light - 1
    assert residual.std() < 0.004


def test_uniform_light_does_not_change() -> None:
    flat = np.full((3, *SIZE), 0.5, np.float32)
    np.testing.assert_array_equal(denoise_flat(flat, flat), flat)


def test_small_frames_do_not_change() -> None:
    flat = illumination()[:, :20, :20]
    np.testing.assert_allclose(denoise_flat(flat, flat), flat, rtol=1e-5)
