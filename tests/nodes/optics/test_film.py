"""Equation F1 has the properties of a film that are known without any fit."""

import numpy as np
import pytest

from tactograph.nodes.optics.film import (
    FADE_WIDTH,
    _changes,
    _reflected,
    is_affine,
    predict,
    rest_below,
    turned,
)
from tactograph.nodes.optics.near_light import vectors_at
from tests.nodes.films import FILMS, LEDS, MATT, normals

RNG = np.random.default_rng(2)
X, Y, Z = RNG.uniform(-9, 9, 50), RNG.uniform(-7, 7, 50), RNG.uniform(0, 2, 50)
N = normals(RNG.uniform(-0.5, 0.5, (2, 50)))
MIDDLES = (np.arange(40) + 0.5) / 40
REST = np.repeat([[0.0], [0.0], [1.0]], 50, axis=1)
NONE = np.zeros(50)


def test_a_matt_film_has_the_light_of_near_lights() -> None:
    expected = np.einsum("kcn,cn->kn", vectors_at(LEDS, X, Y, Z), N)
    assert predict(MATT, N, X, Y, Z) == pytest.approx(np.maximum(expected, 0), abs=1e-6)


@pytest.mark.parametrize("name", FILMS)
def test_the_film_at_rest_has_the_flat_frames_light(name: str) -> None:
    assert predict(FILMS[name], REST, X, Y, NONE) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", FILMS)
def test_only_a_matt_film_is_a_linear_function_of_the_normal(name: str) -> None:
    assert is_affine(FILMS[name]) == (name in {"diffuse", "soft", "disks", "board"})


def test_a_coat_that_does_not_refract_has_no_effect() -> None:
    nearly = MATT._replace(base=0.6, roughness=0.3, refraction=1 + 1e-4)
    assert predict(nearly, N, X, Y, Z) == pytest.approx(predict(MATT, N, X, Y, Z), abs=1e-5)


@pytest.mark.parametrize("slant", [0, 30, 60])
def test_a_coat_reflects_no_more_than_it_receives(slant: float) -> None:
    """Light from one direction, summed over all directions to the camera."""
    film, far = MATT._replace(base=1.0, roughness=0.3, refraction=1.5), 1e5
    angle = np.radians(slant)
    light = np.array([np.sin(angle), 0, np.cos(angle)])
    cosine, turn = (g.ravel() for g in np.meshgrid(MIDDLES, 2 * np.pi * MIDDLES))
    sine = np.sqrt(1 - cosine**2)
    # The camera stays in place: film and light are turned, by Rodrigues' formula.
    pivot = np.stack([-np.sin(turn), np.cos(turn)])
    at = np.zeros(1)
    total = 0.0
    for x, y, c, s in zip(*pivot, cosine, sine, strict=True):
        cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
        turning = np.eye(3) - s * cross + (1 - c) * cross @ cross
        n = turning @ np.array([0.0, 0.0, 1.0])
        film = film._replace(lights=far * (turning @ light)[None])
        (reflected,) = _reflected(film, n[:, None], at, at, at)
        total += float(reflected[0]) * far**2 / np.cos(angle) * c * 2 * np.pi / cosine.size
    assert 0.5 < total < 1


def test_diffused_light_remains_in_a_shadow() -> None:
    away = normals(-4 * LEDS[:1, :2].T / np.linalg.norm(LEDS[0, :2]) * -1)
    film = FILMS["diffuse"]
    light = predict(film, away, *np.zeros((3, 1)))
    assert (LEDS[0] @ away) < 0
    assert light[0] == pytest.approx(film.diffuse[0], abs=1e-6)


def test_film_is_brighter_where_it_is_touched() -> None:
    film, low, high = FILMS["diffuse"], np.full(50, 1e-6), np.full(50, FILMS["diffuse"].contact)
    assert predict(film, REST, X, Y, low) == pytest.approx(1, abs=1e-3)
    tall = predict(film._replace(gain=1.0), REST, X, Y, high)
    assert predict(film, REST, X, Y, high) == pytest.approx(1.05 * tall)


@pytest.mark.parametrize("aim", [0.0, 1.0, -0.3])
def test_a_disk_shines_by_the_cosine_to_its_axis(aim: float) -> None:
    """To the middle of the film, straight down, or flatter than to the middle."""
    film = MATT._replace(emission=1.0, aim=aim)
    places = np.stack([X, Y, Z]) - LEDS[:, :, None]
    below = np.stack([X, Y, NONE]) - LEDS[:, :, None]

    def cosine(ray: np.ndarray) -> np.ndarray:
        down = LEDS * [aim - 1, aim - 1, -1]
        axis = down / np.linalg.norm(down, axis=1, keepdims=True)
        return np.einsum("kc,kcn->kn", axis, ray) / np.linalg.norm(ray, axis=1)

    by_disks = predict(MATT, N, X, Y, Z) * cosine(places) / cosine(below)
    assert predict(film, N, X, Y, Z) == pytest.approx(by_disks, abs=1e-6)
    for m in (0.3, 2.0, 3.0):
        shine = predict(film._replace(emission=m), N, X, Y, Z) / predict(MATT, N, X, Y, Z)
        assert shine == pytest.approx((cosine(places) / cosine(below)) ** m, abs=2e-3)


def test_harmonics_end_at_the_slopes_that_were_pressed() -> None:
    film = FILMS["harmonics"]
    pressed, beyond = film.flattest + 0.01, film.flattest - FADE_WIDTH - 0.01
    for nz, bent in ((pressed, True), (beyond, False)):
        n = np.array([[np.sqrt(1 - nz * nz)], [0.0], [nz]])
        at = n, *np.zeros((3, 1))
        difference = predict(film, *at) - predict(film._replace(harmonics=MATT.harmonics), *at)
        assert (np.abs(difference) > 1e-4).any() == bent


def test_a_pupil_near_the_film_sees_the_film_at_rest_elsewhere() -> None:
    film, z = FILMS["camera"], np.array([2.0])
    x = np.array([8.0])
    apparent = x / (1 - film.camera * z)
    n = np.array([[0.0], [0.0], [1.0]])
    away = [np.linalg.norm(LEDS - [p[0], 0, h], axis=1) for p, h in ((x, 2.0), (apparent, 0.0))]
    expected = (LEDS[:, 2] - 2) / LEDS[:, 2] * (away[1] / away[0]) ** 3
    assert predict(film, n, x, np.zeros(1), z)[:, 0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", FILMS)
def test_light_changes_with_the_normal_as_its_derivatives_state(name: str) -> None:
    film, (nx, ny, nz), step = FILMS[name], N, 1e-4
    none = np.zeros_like(nx)
    tangents = np.stack([nz, none, -nx]), np.stack([none, nz, -ny])
    place = X, Y, Z
    lit = predict(film, N, *place) > film.diffuse[:, None] + 0.05
    changes = _changes(film, N, place, rest_below(film, *place), Z)
    for along, change in zip(tangents, changes, strict=True):
        before, after = (
            predict(film, n / np.linalg.norm(n, axis=0), *place)
            for n in (N - step * along, N + step * along)
        )
        # Masking is taken as constant.
        room = 1e-4 if film.refraction == 1 else 0.01
        expected = (after - before) / (2 * step)
        assert np.abs(change - expected)[lit].max() < room * np.abs(expected).max()


@pytest.mark.parametrize("name", FILMS)
def test_steps_of_the_normal_find_the_one_that_light_comes_from(name: str) -> None:
    film = FILMS[name]
    light, n = predict(film, N, X, Y, Z), REST
    for _ in range(6):
        n = turned(film, light, n, (X, Y, Z))
    assert np.degrees(np.linalg.norm(n - N, axis=0)).max() < 0.1
