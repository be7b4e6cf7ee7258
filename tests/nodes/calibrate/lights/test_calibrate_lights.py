"""A ball and the untouched film determine where the LEDs are."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.ball.ball_slopes import BallSlopes, ball_slopes
from tactograph.nodes.calibrate.lights.calibrate_lights import LightsFit, calibrate_lights
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.calibrate.rest.estimate_noise import estimate_noise
from tactograph.nodes.calibrate.rest.rest_light import rest_light
from tactograph.nodes.calibrate.tables.label_lit import label_lit
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render
from tactograph.nodes.slope.height_slopes import height_slopes

PIXEL, RADIUS, CONTACT = 0.1, 5.0, 42.0
SIZE = (120, 160)
CENTER = np.array([83.4, 57.8], np.float32)
FILM = np.zeros(SIZE, np.float32)
BLANK = np.zeros((4, *SIZE), np.float32)
RING = light_ring(slant_deg=33.0, distance_mm=55.0)


def known(center: F4 = CENTER) -> BallSlopes:
    return ball_slopes(BLANK, center, CONTACT, PIXEL, radius_mm=RADIUS, margin_px=0.0)


def images(lights: F4, seed: int = 0, noise: float = 0.002) -> tuple[F4, F4]:
    """Images of the ball and of the film at rest by a camera with vignetting and noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:1:120j, :1:160j]
    gain = 1 - 0.3 * ((x - 0.4) ** 2 + (y - 0.6) ** 2)
    clean = [render(z, PIXEL, lights, samples=2).light * gain for z in (known().height, FILM)]
    ball, flat = ((m + rng.normal(0, noise, m.shape)).astype(np.float32) for m in clean)
    return ball, flat


def calibrate(ball: F4, flat: F4, shape: BallSlopes) -> LightsFit:
    light = ball / np.maximum(flat, np.float32(0.02))
    lit = label_lit(light)
    return calibrate_lights(light, flat, shape.slope, shape.mask, shape.height, lit, PIXEL)


def off(fitted: F4, lights: F4) -> float:
    """The error of the fitted LEDs, as a share of their distance."""
    away = np.linalg.norm(fitted - lights, axis=1) / np.linalg.norm(lights, axis=1)
    return float(away.max())


@pytest.mark.parametrize(("slant", "distance"), [(33.0, 55.0), (30.0, 300.0)])
@pytest.mark.parametrize("count", [3, 4])
def test_leds_are_found(slant: float, distance: float, count: int) -> None:
    lights = light_ring(slant_deg=slant, distance_mm=distance, count=count)
    fit = calibrate(*images(lights), known())
    assert off(fit.film.lights, lights) < 0.01
    assert fit.residual.max() < 0.02


def test_hot_pixels_are_no_misfit_of_the_leds() -> None:
    """As in `fit_film`: one pixel in a thousand, bright in every image."""
    hot = np.random.default_rng(9).random(SIZE) < 0.001
    ball, flat = images(RING)
    ball = np.where(hot, 3 * flat, ball)
    assert calibrate(ball, flat, known()).residual.max() < 0.02


@pytest.mark.slow
def test_the_error_of_the_leds_is_as_large_as_the_fit_states() -> None:
    off_by, stated = [], []
    for seed in range(4):
        fit = calibrate(*images(RING, seed, noise=0.01), known())
        off_by.append(np.square(fit.film.lights - RING).mean())
        stated.append(np.square(fit.film.other_lights - fit.film.lights).mean())
    assert 0.5 < np.sqrt(np.mean(off_by) / np.mean(stated)) < 2


def test_a_ball_that_is_off_by_a_fraction_of_a_pixel_is_corrected() -> None:
    shifted = known(CENTER + np.array([0.3, -0.25], np.float32))
    fit = calibrate(*images(RING), shifted)
    assert off(fit.film.lights, RING) < 0.01


def test_without_a_flat_frame_the_ball_alone_places_the_leds() -> None:
    ball = render(known().height, PIXEL, RING, samples=2).light
    rest = render(FILM, PIXEL, RING).light
    uniform = np.ones_like(ball)
    fit = calibrate(ball, uniform, known())
    assert off(fit.film.lights, RING) < 0.02
    model = rest_light(uniform, fit.film.lights, fit.strength, PIXEL)
    assert np.abs(model / rest - 1).max() < 0.01
    assert rest_light(rest, fit.film.lights, fit.strength, PIXEL) is rest


def test_any_known_height_places_the_leds() -> None:
    y, x = np.mgrid[:120, :160]
    height = (1.5 * np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 2 / 22**2)).astype(np.float32)
    slope, mask = height_slopes(height, PIXEL)
    light = render(height, PIXEL, RING).light
    flat = render(FILM, PIXEL, RING).light
    fit = calibrate(light, flat, BallSlopes(slope, mask, height))
    assert off(fit.film.lights, RING) < 0.01


def test_an_led_that_is_off_is_named() -> None:
    ball, flat = images(RING)
    ball[2] = 0
    with pytest.raises(InputError, match="LED 3 reaches only"):
        calibrate(ball, flat, known())


def test_a_contact_that_is_too_small_is_named_not_an_led() -> None:
    ball, flat = images(RING)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    inside = (np.hypot(x - CENTER[0], y - CENTER[1]) < 7).astype(np.uint8)
    with pytest.raises(InputError, match="LEDs reach only 57 pixels of the calibration object"):
        calibrate(ball, flat, known()._replace(mask=inside))


@pytest.mark.parametrize(("shot", "read"), [(0.0, 4e-6), (2e-5, 0.0), (1e-5, 4e-6)])
def test_shot_and_read_noise_are_separated(shot: float, read: float) -> None:
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:1:240j, :1:320j]
    clean = np.stack([0.1 + 0.8 * x, 0.9 - 0.7 * y])
    image = clean + rng.normal(0, 1, clean.shape) * np.sqrt(shot * clean + read)
    estimate = estimate_noise(image.astype(np.float32))
    for light in (0.15, 0.5, 0.85):
        assert estimate[0] * light + estimate[1] == pytest.approx(shot * light + read, rel=0.1)


def test_an_edge_is_no_noise() -> None:
    image = np.full((4, 120, 160), 0.5, np.float32)
    image[:, 40:80, 50:90] = 0.3
    assert estimate_noise(image)[1] == pytest.approx(1e-8)


def test_noise_is_relative_to_the_film_at_rest() -> None:
    image = np.full((4, 2, 2), 0.3, np.float32)
    flat = np.full((4, 2, 2), 0.6, np.float32)
    noise = light_noise(image, flat, np.array([1e-4, 1e-5], np.float32))
    assert noise == pytest.approx(np.sqrt(1e-4 * 0.3 + 1e-5) / 0.6)


def test_a_frame_under_leds_with_a_lens_tells_what_points_would_light() -> None:
    frames = {
        m: Rest.of(render(FILM, PIXEL, RING, cosine_leds=m > 0).light.astype(np.float32), PIXEL)
        for m in (0, 1)
    }
    film = Film.matt(RING)._replace(emission=1.0)
    assert frames[0] is not None
    assert frames[1] is not None
    points = frames[1].under_points(film).logarithm
    assert np.abs(frames[1].logarithm - frames[0].logarithm).max() > 3e-3
    assert np.abs(points - frames[0].logarithm).max() < 1e-5
