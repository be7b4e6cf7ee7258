"""One verdict on a touch, and its cause in words."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4, U1, Metrics
from tactograph.nodes.optics.lens import nearest_ideal
from tactograph.nodes.trust.fall_off import fall_off
from tactograph.nodes.trust.film_motion import film_motion
from tactograph.nodes.trust.film_on_rims import film_on_rims
from tactograph.nodes.trust.judge_touch import judge_touch
from tactograph.nodes.trust.rim_cells import rim_cells
from tactograph.nodes.trust.touch_evidence import touch_evidence
from tests.nodes.trust.law import ranks

SHAPE = (30, 40)
REST, HEIGHT = np.ones((4, *SHAPE), np.float32), np.zeros(SHAPE, np.float32)
SLOPE = np.full((2, *SHAPE), 0.3, np.float32)
RANKS = ranks()


def judged(
    curl: float, rest: float = 1.0, light: float | None = None, **options: object
) -> Metrics:
    """Uniform curl and departure of the light, over their sizes; `rest` is LED 2's light."""
    image = REST.copy()
    image[1] *= np.float32(rest)
    departure = None if light is None else np.full(SHAPE, light**2, np.float32)
    curls = np.full(SHAPE, curl * abs(curl), np.float32)
    evidence = touch_evidence(curls, image, HEIGHT, departure=departure, slope=SLOPE)
    return judge_touch(evidence, **{"ranks": RANKS} | options)  # type: ignore[arg-type]


def warnings_of(
    curl: float, rest: float = 1.0, light: float | None = None, **options: object
) -> list[str]:
    with collect_warnings([]) as notes:
        judged(curl, rest, light, **options)
    return notes


def test_a_touch_without_contradictions_is_trusted() -> None:
    verdict = judged(0.1, light=0.3)
    assert list(verdict) == ["trust", "check_curl", "check_light", "check_rest"]
    assert min(verdict.values()) == verdict["trust"] > 0.3
    assert not warnings_of(0.1, light=0.3)
    assert "check_light" not in judged(0.1), "what is not checked has no figure"
    assert "check_rest" not in judged(0.1, filled=True)
    assert judged(-1.0)["check_curl"] > 0.3, "an untested check does not count against it"


def test_trust_falls_with_contradictions_and_false_alarms_limits_it() -> None:
    figures = [judged(curl)["trust"] for curl in (0.5, 1.0, 1.5, 2.0)]
    assert figures == sorted(figures, reverse=True)
    assert figures[3] < 0.01 < figures[0]
    rare = 1.01 * judged(1.2)["trust"]
    assert warnings_of(1.2, false_alarms=rare)
    assert not warnings_of(1.2, false_alarms=0.98 * judged(1.2)["trust"])


def test_a_calibration_without_ranks_warns_that_nothing_is_checked() -> None:
    for known in (None, np.full_like(RANKS, -1)):
        assert judged(9.0, ranks=known, only_warn=True) == {}
        (line,) = warnings_of(9.0, ranks=known)
        assert line.startswith("this touch is not checked")
        assert "rank_checks calibration=FILE" in line


def test_a_warning_names_the_cause_and_the_cure() -> None:
    (line,) = warnings_of(1.9)
    assert line.startswith("no surface has these slopes (check the order of the images")
    assert line.endswith("; the height may be wrong")
    assert "\n" not in line


def test_the_worst_cause_is_named_first_and_a_passed_check_is_not_named() -> None:
    (line,) = warnings_of(9.0, rest=0.8, light=0.1)
    slopes, led = line.index("no surface has these slopes"), line.index("LED 2 is darker by 20%")
    assert slopes < led
    assert "the light of the touch" not in line


@pytest.mark.parametrize(
    ("added", "shift", "words"),
    [
        (0.01, 0, "or is it other light, or a higher black level? All LEDs together are brighter"),
        (-0.01, 0, "or is it a lower black level, or other light that has gone?"),
        (0.0, 3, ""),
    ],
)
def test_added_light_is_not_reported_as_a_zoom_alone(added: float, shift: int, words: str) -> None:
    """Five counts of 255 look like a zoom of 4 %."""
    notes = warnings_at_rest(near_light(2.0), added, shift)
    assert "does not lie where the flat frame shows it" in notes[0]
    assert words in notes[0]
    assert ("or is it" in notes[0]) == bool(words)


def test_added_light_is_reported_where_no_zoom_explains_it() -> None:
    """Two counts of 255 put heights 15 um off."""
    (line,) = warnings_at_rest(near_light(1.5), 0.01, 0)
    assert line.startswith("on the film at rest all LEDs together are brighter by 1.9%")
    assert "keep other light out" in line


def near_light(away: float) -> F4:
    """Four LEDs near a square film, each over its own corner."""
    y, x = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    places = [(-away, -away), (away, -away), (away, away), (-away, away)]
    light = [1 / ((x - u) ** 2 + (y - v) ** 2 + 4 * away - 2) for u, v in places]
    return np.asarray(light / np.mean(light) * 0.6, np.float32)


def warnings_at_rest(rest: F4, added: float, shift: int) -> list[str]:
    light = (np.roll(rest, shift, 2) + np.float32(added)) / rest
    light[:, :, :shift] = 1
    motion = film_motion(light, fall_off(rest), rest)
    evidence = touch_evidence(HEIGHT, light, HEIGHT)
    with collect_warnings([]) as notes:
        judge_touch(evidence, RANKS, motion=motion, light=light, flat=rest, only_warn=True)
    return notes


def test_leds_that_dim_together_are_named_together() -> None:
    evidence = touch_evidence(HEIGHT, 0.8 * REST, HEIGHT)
    with collect_warnings([]) as notes:
        judge_touch(evidence, RANKS)
    assert notes[0].startswith("all LEDs are darker by 20% than in the calibration")


def test_a_touch_that_fails_all_checks_is_refused_unless_forced() -> None:
    wrong = {"curl": 9.0, "rest": 0.7, "light": 20.0}
    with pytest.raises(InputError) as refused:
        judged(**wrong)
    line = str(refused.value)
    assert all(cause in line for cause in ("has these slopes", "LED 2 is darker", "light of the"))
    assert line.endswith("no height is computed; `only_warn`=true continues")
    assert len(warnings_of(**wrong, only_warn=True)) == 1
    assert judged(**wrong, only_warn=True)["trust"] < 1e-6
    assert len(warnings_of(9.0, rest=0.7, light=1.0)) == 1, "two of three are no refusal"


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1)])
def test_an_image_of_a_few_cells_has_a_verdict(shape: tuple[int, int]) -> None:
    untested, level = np.full(shape, -1, np.float32), np.zeros(shape, np.float32)
    evidence = touch_evidence(untested, np.ones((4, *shape), np.float32), level)
    assert judge_touch(evidence, RANKS)["trust"] > 0.1


def dome(wall: float, gap: int = 0) -> dict[str, F4]:
    """A plateau of 0.5 mm behind a wall of that slope, and a ramp in a gap of the wall."""
    y, x = np.indices(SHAPE)
    away = np.hypot(x - 20, y - 15)
    height, slope = np.where(away < 9, 0.5, 0).astype(np.float32), np.zeros((2, *SHAPE), np.float32)
    slope[0][(away >= 7) & (away < 9) & (np.abs(y - 15) >= gap)] = wall
    return {"height": height, "slope": slope, "used": np.full(SHAPE, 15, np.uint8)}


def rims_of(scene: dict[str, F4]) -> U1:
    return rim_cells(scene["slope"], scene["used"])


def share(scene: dict[str, F4]) -> float:
    return film_on_rims(scene["height"], rims_of(scene), REST).share


def test_film_that_rims_enclose_depends_on_them() -> None:
    assert share(dome(3.0)) == 1
    assert share(dome(1.1)) == 0, "cells resolve slopes that turn so little"
    assert 0.2 < share(dome(3.0, gap=2)) < 0.5, "a ramp next to the rim measures the top"
    shaded = dome(1.1)
    shaded["used"][shaded["slope"][0] > 0] = 0b0101
    assert share(shaded) == 1
    assert share(shaded | {"height": HEIGHT, "slope": 0 * SLOPE}) == 0, "nothing is touched"


def test_film_that_depends_on_rims_is_marked_on_the_pixels() -> None:
    like = np.zeros((1, 4 * SHAPE[0] - 1, 4 * SHAPE[1] - 1), np.float32)
    steep, gentle = dome(3.0), dome(1.1)
    marked = film_on_rims(steep["height"], rims_of(steep), like).film
    assert marked.shape == like.shape[1:]
    assert np.array_equal(marked[2::4, 2::4], steep["height"] > 0)
    assert not film_on_rims(gentle["height"], rims_of(gentle), like).film.any()
    lens = np.array([-0.1, 0, 0, 0, 0, 0, 0, 0], np.float32)
    distorted = film_on_rims(steep["height"], rims_of(steep), like, lens).film
    true = marked[nearest_ideal(lens, marked.shape)]
    assert np.count_nonzero(distorted != true) < 0.05 * np.count_nonzero(true)


@pytest.mark.parametrize(("hanging", "measured", "count"), [(0.5, 0, 1), (0.5, 1, 0), (0.2, 0, 0)])
def test_rims_give_a_warning_unless_something_else_measures_them(
    hanging: float, measured: bool, count: int
) -> None:
    notes: list[str] = []
    with collect_warnings(notes):
        verdict = judged(0.1, rim_share=hanging, rims_measured=measured)
    assert verdict["rim_share"] == hanging
    assert notes == [note for note in notes if "50% of the touch depends on rims" in note]
    assert len(notes) == count


@pytest.mark.parametrize(("measured", "is_advised"), [(False, True), (True, False)])
def test_precise_is_not_advised_where_it_ran(measured: bool, is_advised: bool) -> None:
    (line, *_) = warnings_of(0.1, light=9.0, rim_share=0.5, rims_measured=measured, only_warn=True)
    assert line.startswith("no surface explains the light of the touch")
    assert ("walls and rims need the graph precise" in line) == is_advised
