"""A real one-shot sensor's light says little of the radius of a ball."""

from functools import cache

import numpy as np
import pytest

from tactograph.nodes import Film
from tactograph.nodes.calibrate.film.judge_radius import JudgedRadius, judge_radius
from tactograph.nodes.optics.film import predict
from tactograph.rings.oneshot.nodes.presses.level_presses import level_presses
from tactograph.rings.oneshot.nodes.presses.press_evidence import press_evidence
from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses
from tests.fixtures import real_data
from tests.nodes.films import MATT, ball_seen, normals

COATED = MATT._replace(base=0.6, roughness=0.4, refraction=1.5)


@cache
def mini() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some presses of the GelSight Mini, its film at rest, and their circles."""
    data = real_data("gelsight_mini_balls")
    film = read_presses(folder=data / "6.310mm", flat=data / "background.png")
    labels = np.genfromtxt(data / "labels.csv", delimiter=",", skip_header=1, usecols=(2, 3, 4))
    numbers = np.array([int(name) for name in film.names])
    inside = (np.abs(labels[:, 0] - 160) < 130) & (np.abs(labels[:, 1] - 120) < 90)
    some = np.flatnonzero(inside[numbers])[::2]
    return level_presses(film.image[some], film.flat), film.flat, labels[numbers[some]]


@pytest.mark.one_case
@pytest.mark.parametrize(("radius", "likelier"), [(3.155, False), (6.31, True)])
def test_a_real_one_shot_sensor_leaves_the_radius_open(radius: float, likelier: bool) -> None:
    image, flat, circle = mini()
    kept = np.ones(len(image), np.uint8)
    circle = circle.astype(np.float32)
    verdict = judge_radius(press_evidence(image, flat, circle, kept, 0.0634, radius_mm=radius))
    assert not verdict.doubts
    assert "does not confirm the ball's radius" in verdict.unconfirmed
    assert ("times likelier" in verdict.unconfirmed) == likelier
    assert verdict.quality["scale_error_percent"] > 20


def judged(film: Film, gamma: float, noise: float = 0.004) -> JudgedRadius:
    """What is found of a ball of 5 mm, seen by a camera that raises light to a power."""
    size, pixel, rim = (96, 128), 20 / 128, 4.4
    seen, slope, _ = ball_seen(5.0, rim, (1.0, -0.5), 0.0, size)
    y, x = ((np.indices(size) - np.array([47.5, 63.5])[:, None, None]) * pixel).reshape(2, -1)
    light = predict(film, normals(slope).reshape(3, -1), x, y, seen.ravel().astype(np.float64))
    light = light + np.random.default_rng(1).normal(0, noise, light.shape)
    image = (np.maximum(light, 0) ** gamma).reshape(1, -1, *size).astype(np.float32)
    circle = np.array([[63.5 + 1 / pixel, 47.5 - 0.5 / pixel, rim / pixel]], np.float32)
    flat, kept = np.ones_like(image[0]), np.ones(1, np.uint8)
    return judge_radius(press_evidence(image, flat, circle, kept, pixel, radius_mm=5.0))


def test_a_coat_is_not_mistaken_for_gamma() -> None:
    assert not judged(COATED, 1.0).doubts
    assert "the camera raises to the power" in judged(MATT, 1.4).doubts[0]


def test_a_film_counts_as_matt_where_noise_explains_the_residual() -> None:
    assert judged(MATT, 1.0, noise=0.02).quality.get("matt") == 1
    assert "matt" not in judged(COATED, 1.0, noise=0.02).quality
