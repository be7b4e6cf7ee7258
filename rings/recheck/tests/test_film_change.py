"""Each cause of a change on untouched film is named."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tactograph.graph import InputError
from tactograph.nodes import F4, Film
from tactograph.rings.recheck.nodes._led_order import other_order
from tactograph.rings.recheck.nodes.film_change import FilmChange, film_change
from tactograph.rings.recheck.nodes.film_tilt import film_tilt
from tactograph.rings.recheck.nodes.judge_film import Verdicts, judge_film
from tests.nodes.gels import FLASHED, PIXEL_MM, Gel, X, Y, bump

GEL = Gel()
TILT = film_tilt(GEL.rest, Film.matt(FLASHED), PIXEL_MM)
SCRATCH = (1 - 0.4 * ((np.abs(X - Y - 2) < 0.2) & (np.abs(X) < 4))).astype(np.float32)


def at_rest(light: F4) -> F4:
    """A capture of the untouched film, as `read_flat` smooths it."""
    return np.stack([gaussian_filter(plane, 2.0, mode="nearest") for plane in light])


THEN = at_rest(GEL.seen())


def changed(light: F4) -> FilmChange:
    return film_change(THEN, at_rest(light), TILT, PIXEL_MM)


def judged(light: F4) -> Verdicts:
    return judge_film(changed(light), PIXEL_MM)


def wrong(light: F4) -> set[str]:
    """The causes that are found."""
    verdicts = judged(light)._asdict()
    return {
        name
        for name, verdict in verdicts.items()
        if isinstance(verdict, str) and not verdict.startswith("right")
    }


def moved(light: F4, x: float, y: float) -> F4:
    by, size = np.array([[1, 0, x], [0, 1, y]], np.float32), light.shape[:0:-1]
    how = {"flags": cv2.INTER_CUBIC, "borderMode": cv2.BORDER_REPLICATE}
    return np.stack([cv2.warpAffine(plane, by, size, **how) for plane in light])


def dented(height: float) -> F4:
    gel = Gel()
    gel.dent = bump(3, -2, 0.8, height)
    return gel.seen()


def noisy(light: F4, seed: int) -> F4:
    return light + np.random.default_rng(seed).normal(0, 0.002, light.shape).astype(np.float32)


@pytest.mark.parametrize("seed", range(5))
def test_the_same_film_is_right_whatever_its_noise_and_drift(seed: int) -> None:
    assert wrong(noisy(GEL.seen(), seed)) == set()
    drift = np.random.default_rng(seed).normal(1, 0.02, (4, 1, 1)).astype(np.float32)
    assert wrong(noisy(drift * GEL.seen(), seed)) == set()


@pytest.mark.parametrize(
    ("change", "by"), [("dent", -54.4), ("strength", -3.08), ("ambient", -0.3)]
)
def test_an_impossible_change_means_another_sensor(change: str, by: float) -> None:
    found = changed(GEL.seen())
    value = getattr(found, change)
    if change == "dent":
        value = np.where(np.hypot(X, Y) < 1, np.float32(by), value)
    elif change == "strength":
        value = value + np.array([0, 0, by, 0], np.float32)
    else:
        value = by
    verdicts = judge_film(found._replace(**{change: value}), PIXEL_MM)
    assert all("is this another sensor" in verdict for verdict in verdicts[:5])


def test_a_weak_led_is_named() -> None:
    light = GEL.seen() * np.array([1, 0.8, 1, 1], np.float32)[:, None, None]
    assert wrong(light) == {"leds"}
    assert changed(light).strength == pytest.approx([1, 0.8, 1, 1], abs=0.01)
    assert "LED 2" in judged(light).leds


def test_dim_light_of_all_leds_is_named() -> None:
    light = GEL.seen() * np.float32(0.85)
    assert wrong(light) == {"leds"}
    assert "all LEDs have 85 %" in judged(light).leds


def test_light_from_no_led_is_measured() -> None:
    light = GEL.seen() + np.float32(0.02)
    assert wrong(light) == {"ambient"}
    assert changed(light).ambient == pytest.approx(0.02, abs=0.002)


@pytest.mark.parametrize("by", [(1.3, -0.7), (7.0, -4.0)])
def test_an_image_that_moved_is_measured(by: tuple[float, float]) -> None:
    light = moved(GEL.seen(), *by)
    assert wrong(light) == {"camera"}
    assert changed(light).shift == pytest.approx(by, abs=0.25)


def test_a_changed_black_level_is_neither_dent_nor_scratch() -> None:
    """Dark corners end at black: they say nothing of the film."""
    dark = 1 - 0.95 * np.clip(np.hypot(X / X.max(), Y / Y.max()) / 1.4, 0, 1) ** 3
    then = GEL.seen() * dark
    now = np.clip(then - np.float32(0.026), 0, 1)
    change = film_change(at_rest(then), at_rest(now), TILT, PIXEL_MM)
    assert change.ambient == pytest.approx(-0.026, rel=0.1)
    verdicts = judge_film(change, PIXEL_MM)
    assert verdicts.ambient.startswith("the black level has changed: every image is 2.")
    assert verdicts.film.startswith("right")


def test_a_dent_above_the_noise_is_named() -> None:
    assert wrong(noisy(dented(0.03), 1)) == {"film"}
    assert wrong(noisy(dented(0.001), 1)) == set()


def test_a_dent_has_its_height_and_a_touch_is_not_a_dent() -> None:
    light = dented(0.03)
    assert wrong(light) == {"film"}
    assert changed(light).dent.max() == pytest.approx(0.03, rel=0.3)
    assert "touches the film" in judged(dented(0.6)).film


@pytest.mark.parametrize("order", [[1, 2, 3, 0], [1, 0, 2, 3], [0, 3, 2, 1]])
@pytest.mark.parametrize("new_film", [True, False])
def test_images_in_another_order_are_refused(order: list[int], new_film: bool) -> None:
    gel = Gel(seed=9, thicker=0.3, albedo=0.5) if new_film else GEL
    with pytest.raises(InputError) as caught:
        film_change(THEN, at_rest(gel.seen())[order], TILT, PIXEL_MM, new_film=new_film)
    message = str(caught.value)
    for image, led in enumerate(order, start=1):
        assert (f"image {image} has the light of LED {led + 1}" in message) == (image != led + 1)


def test_noise_is_not_another_order() -> None:
    rng = np.random.default_rng(0)
    then, now = 0.5 + rng.normal(0, 0.01, (2, 4, 60, 80)).astype(np.float32)
    assert other_order(then, now, PIXEL_MM) is None
    assert other_order(0 * then + 1, now, PIXEL_MM) is None


def test_a_blurred_spot_is_on_the_lens_and_a_sharp_line_in_the_film() -> None:
    assert wrong(GEL.seen() * (1 - bump(-4, 2, 1.6, 0.2))) == {"lens"}
    assert wrong(GEL.seen() * SCRATCH) == {"film"}


def test_another_film_has_a_dent_of_its_own_but_no_shift() -> None:
    gel = Gel(seed=9, thicker=0.3, alpha=0.25, albedo=0.5, dent=0.06)
    change = film_change(THEN, at_rest(gel.seen()), TILT, PIXEL_MM, new_film=True)
    assert change.dent.max() == pytest.approx(0.06, rel=0.3)
    assert not change.shift.any()
    assert change.ambient == 0
