"""The edge where film leaves a ball, found with a known film."""

import numpy as np
import pytest

from tactograph.nodes import Film
from tactograph.nodes.calibrate.film._contact_edge import contact_edge
from tactograph.nodes.optics.film import predict

RADIUS, RIM, PIXEL = 6.0, 5.0, 0.07
LIGHTS = np.array([(21, 21, 36), (-21, 21, 36), (-21, -21, 36), (21, -21, 36)], np.float32)
MATT = Film.matt(LIGHTS)
COATED = MATT._replace(base=0.7, roughness=0.2, refraction=1.5)


def press(film, thrown, reach=0.0):
    """A ball in a film: places, light and what film throws on film, brightest around the foot.

    Beside the ball the film hangs, and its slope falls to 1 / e within `reach`.
    """
    u, v = (a.ravel() for a in np.meshgrid(*[np.arange(-110, 111) * PIXEL] * 2))
    away, sunk = np.hypot(u, v), np.sqrt(RADIUS**2 - RIM**2)
    inside = away < RIM
    z = np.where(inside, np.sqrt(np.maximum(RADIUS**2 - away**2, 0)) - sunk, 0)
    hanging = RIM / sunk * np.exp(-np.maximum(away - RIM, 0) / max(reach, 1e-6)) * (reach > 0)
    aside = np.stack([u, v, away / np.maximum(hanging, 1e-6)])
    length = np.maximum(np.linalg.norm(aside, axis=0), 1e-6)
    aside = np.where(hanging > 1e-6, aside / length, [[0], [0], [1]])
    n = np.where(inside, np.stack([u, v, z + sunk]) / RADIUS, aside)
    bounce = np.tile(thrown * np.exp(-np.abs(away - RIM)), (4, 1))
    return u, v, predict(film, n, u, v, z) + bounce, np.zeros_like(bounce), (0.0, 0.0, -sunk)


@pytest.mark.parametrize("film", [MATT, COATED], ids=["matt", "coated"])
@pytest.mark.parametrize("known", [0.88, 1.0, 1.12])
@pytest.mark.parametrize("thrown", [0.0, 0.15])
def test_a_badly_known_contact_is_corrected(film, known, thrown):
    """Light that the film throws on its foot and that the model lacks does not mislead it."""
    *samples, centre = press(film, thrown)
    edge = contact_edge(*samples, centre, RADIUS, known * RIM, film)
    assert edge == pytest.approx(RIM, abs=PIXEL)


@pytest.mark.parametrize("film", [MATT, COATED], ids=["matt", "coated"])
def test_film_that_hangs_beside_the_ball_does_not_count_as_contact(film):
    *samples, centre = press(film, 0.0, reach=0.6)
    edge = contact_edge(*samples, centre, RADIUS, 0.9 * RIM, film)
    assert edge == pytest.approx(RIM, abs=3 * PIXEL)


def test_noise_moves_the_edge_by_less_than_a_pixel():
    u, v, light, thrown, centre = press(COATED, 0.1)
    noisy = light + np.random.default_rng(0).normal(0, 0.02, light.shape)
    edge = contact_edge(u, v, noisy, thrown, centre, RADIUS, 0.92 * RIM, COATED)
    assert edge == pytest.approx(RIM, abs=PIXEL)


def test_a_ball_beyond_the_image_keeps_its_contact():
    u, v, light, thrown, _ = press(MATT, 0.0)
    edge = contact_edge(u, v, light, thrown, (90.0, 0.0, -3.0), RADIUS, RIM, MATT)
    assert edge == RIM
