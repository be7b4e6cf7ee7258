"""Any film's light becomes that of a matt film of the same shape."""

import inspect

import numpy as np
import pytest

from tactograph.nodes import F4, Film
from tactograph.nodes.light.matt_light import MattLight, matt_light
from tactograph.nodes.optics.film import predict
from tactograph.nodes.optics.near_light import matt_film_light, unwrapped, wrapped
from tests.nodes.films import FILMS, LEDS, MATT, ball_seen, normals

SIZE = 60, 80
PIXEL = 20 / SIZE[1]
REST = np.zeros((2, *SIZE), np.float32)


def ball_under(film: Film) -> tuple[F4, F4, F4, F4]:
    """A pressed ball under a film: light, apparent height, slopes, and where the ball is."""
    height, slope, on = ball_seen(6.0, 4.0, (1.0, -0.5), film.camera, SIZE)
    y, x = (np.mgrid[: SIZE[0], : SIZE[1]] - np.array([29.5, 39.5])[:, None, None]) * PIXEL
    z = height / (1 + film.camera * height)
    nearer = 1 - film.camera * z
    n = normals(slope).reshape(3, -1)
    light = predict(film, n, (x * nearer).ravel(), (y * nearer).ravel(), z.ravel())
    return light.reshape(-1, *SIZE).astype(np.float32), height, slope, on


def matt(film: Film, light: F4, slope: F4, height: F4, **more: object) -> MattLight:
    return matt_light(light, np.full_like(light, 0.01), slope, height, film, PIXEL, **more)


def wanted(height: F4, slope: F4, film: Film = MATT) -> F4:
    direct = matt_film_light(LEDS, height, slope, PIXEL)
    return unwrapped(wrapped(direct, film.wrap), direct, film.wrap)[0]


@pytest.mark.parametrize("name", FILMS)
def test_a_known_shape_has_the_light_of_a_matt_film(name: str) -> None:
    light, height, slope, _ = ball_under(FILMS[name])
    result = matt(FILMS[name], light, slope, height).light
    assert result == pytest.approx(wanted(height, slope, FILMS[name]), abs=2e-4)


@pytest.mark.parametrize("name", FILMS)
def test_a_normal_that_is_ten_degrees_off_does_little_harm(name: str) -> None:
    light, height, slope, on = ball_under(FILMS[name])
    off = slope + np.float32(0.17)
    right = wanted(height, slope, FILMS[name])
    error = np.abs(matt(FILMS[name], light, off, height).light - right)
    without = np.abs(matt(FILMS[name], light, off, height, steps=0).light - right)
    assert error[:, on].max() < 0.01
    if name in {"lobe", "all"}:
        assert error[:, on].max() < 0.3 * without[:, on].max()


@pytest.mark.parametrize("name", FILMS)
def test_the_node_is_idle_for_a_matt_film_alone(name: str) -> None:
    assert matt_light.is_idle is not None
    names = inspect.signature(matt_light.is_idle).parameters

    def idle(film: Film) -> bool:
        known = {f"film_{part}": value for part, value in film._asdict().items()}
        known |= dict.fromkeys(("bounced", "finer", "finest"))
        return matt_light.is_idle(**{part: known[part] for part in names})

    assert idle(MATT)
    assert not idle(FILMS[name])


def test_a_matt_film_that_is_seen_from_afar_keeps_its_light() -> None:
    light, height, _, _ = ball_under(MATT)
    result = matt(MATT, light, REST, height)
    assert np.array_equal(result.light, light)
    assert result.sigma == pytest.approx(0.01)


def test_diffused_and_bounced_light_is_subtracted() -> None:
    film = FILMS["diffuse"]
    shadow = np.broadcast_to(film.diffuse[:, None, None], (4, *SIZE)).astype(np.float32)
    assert matt(film, shadow, REST, REST[0]).light == pytest.approx(0, abs=1e-6)
    light, height, slope, _ = ball_under(film)
    more = np.full_like(light, 0.1)
    wrong = {"bounced": 2 * more}
    for bounce in ({"bounced": more}, wrong | {"finer": more}, wrong | {"finest": more}):
        with_it = matt(film, light + more, slope, height, **bounce)
        assert with_it.light == pytest.approx(wanted(height, slope), abs=1e-5)


def test_darker_light_behind_a_soft_terminator_is_less_certain() -> None:
    film = FILMS["soft"]
    behind = np.array([0.0, -0.05, -0.1, -0.14, -0.17], np.float32)
    light = np.broadcast_to(0.4 + 0.6 * behind, (4, *SIZE[:1], 5)).astype(np.float32)
    level = np.zeros((3, SIZE[0], 5), np.float32)
    result = matt(film, light, level[:2], level[2])
    assert wrapped(result.light, film.wrap) == pytest.approx((light - 0.4) / 0.6, abs=1e-5)
    assert (np.diff(result.sigma, axis=-1) > 0.01).all()


def test_noise_grows_as_the_direct_share_shrinks_and_with_the_film_s_grain() -> None:
    film = FILMS["diffuse"]._replace(gain=1.0)
    result = matt(film, np.ones((4, *SIZE), np.float32), REST, REST[0]).sigma
    assert result[:, 0, 0] == pytest.approx(0.01 / (1 - film.diffuse))
    light = np.full((4, *SIZE), 0.5, np.float32)
    result = matt(MATT._replace(grain=0.02), light, REST, REST[0]).sigma
    assert result == pytest.approx(np.hypot(0.01, 0.02 * 0.5))


@pytest.mark.parametrize("name", ["lobe", "all"])
@pytest.mark.parametrize("part", [0.4, 0.7])
def test_a_penumbra_hardly_changes_the_light_of_other_leds(name: str, part: float) -> None:
    light, height, slope, on = ball_under(FILMS[name])
    shadowed = light.copy()
    shadowed[0] *= part
    known = slope, height
    before = matt(FILMS[name], light, *known).light[1:, on]
    changes = [
        np.abs(matt(FILMS[name], shadowed, *known, penumbras=penumbras).light[1:, on] - before)
        for penumbras in (True, False)
    ]
    assert np.median(changes[0]) < min(0.004, 0.7 * np.median(changes[1]))
