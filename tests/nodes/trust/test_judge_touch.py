"""One verdict on a touch, and its cause in words."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4, U1, Metrics
from tactograph.nodes.optics.lens import nearest_ideal
from tactograph.nodes.trust._curl_check import MAX_MEDIAN
from tactograph.nodes.trust.film_on_rims import film_on_rims
from tactograph.nodes.trust.judge_touch import FilmErrors, judge_touch
from tactograph.nodes.trust.rim_cells import rim_cells
from tactograph.nodes.trust.touch_evidence import touch_evidence

SHAPE = (30, 40)
LIMIT = np.float32(MAX_MEDIAN * MAX_MEDIAN)
REST, HEIGHT = np.ones((4, *SHAPE), np.float32), np.zeros(SHAPE, np.float32)
SLOPE = np.full((2, *SHAPE), 0.3, np.float32)
EXACT = np.zeros(5, np.float32)


def judged(curl: float, rest: float = 1.0, light: float | None = None, **given: object) -> Metrics:
    """Uniform squares of the curl and of the light's departure; `rest` is LED 2's light."""
    seen = REST.copy()
    seen[1] *= np.float32(rest)
    departure = None if light is None else np.full(SHAPE, light, np.float32)
    curls = np.full(SHAPE, curl, np.float32)
    found = touch_evidence(curls, seen, HEIGHT, departure=departure, slope=SLOPE, misfit=EXACT)
    return judge_touch(found, **given)  # type: ignore[arg-type]


def told(curl: float, rest: float = 1.0, light: float | None = None, **given: object) -> list[str]:
    with collect_warnings([]) as notes:
        judged(curl, rest, light, **given)
    return notes


def test_a_touch_that_nothing_speaks_against_is_trusted() -> None:
    found = judged(0.0, light=0.0)
    assert list(found) == ["trust", "check_curl", "check_rest", "check_light"]
    assert found.pop("trust") > 0.9
    assert max(found.values()) <= 0.5
    assert not told(0.0, light=0.0)
    assert "check_light" not in judged(0.0), "what is not checked has no figure"
    untested = judged(-1.0)
    assert untested["check_curl"] == 0, "what no cell tests is not held against it"
    assert not any(np.isnan(figure) for figure in untested.values())
    # As of a one-shot sensor, whose graph has no unevenness to connect.
    assert judged(0.0, light=9.0) == judged(0.0, light=9.0, film=FilmErrors(uneven=0.0))


def test_trust_is_a_half_at_a_limit_and_falls_beyond() -> None:
    figures = [judged(share**2 * LIMIT)["trust"] for share in (0.5, 1.0, 2.0)]
    assert figures == pytest.approx([16 / 17, 1 / 2, 1 / 17], abs=2e-3)


def test_doubts_add_up_and_the_worst_decides() -> None:
    found = judged(0.64 * LIMIT, rest=0.936)
    assert found["check_curl"] == pytest.approx(0.8)
    assert found["check_rest"] == pytest.approx(1.6)
    assert found["trust"] == pytest.approx(1 / (1 + (1.6**8 + 0.8**8) ** 0.5), rel=1e-3)
    assert told(0.92 * LIMIT, rest=0.962), "two checks near their limits"
    assert not told(0.92 * LIMIT)
    assert not told(0.0, rest=0.962)


def test_a_warning_says_the_cause_and_the_cure() -> None:
    assert not told(0.98 * LIMIT)
    (line,) = told(1.1 * LIMIT)
    assert line.startswith("the slopes are those of no surface (check the order of the images")
    assert line.endswith("; the height may be wrong")
    assert "\n" not in line


def test_the_worst_cause_is_named_first_and_what_passed_is_not() -> None:
    (line,) = told(4 * LIMIT, rest=0.94, light=0.0)
    slopes, led = line.index("slopes are those of no surface"), line.index("LED 2 is darker")
    assert slopes < led
    assert "the light of the touch" not in line


def test_least_sets_the_trust_that_is_asked_for() -> None:
    assert not told(1.1 * LIMIT, least=0.1)
    (line,) = told(0.8 * LIMIT, least=0.9)
    assert "slopes are those of no surface" in line


def test_what_fails_all_checks_is_refused_unless_forced() -> None:
    wrong = {"curl": 4 * LIMIT, "rest": 0.7, "light": 20.0}
    with pytest.raises(InputError) as refused:
        judged(**wrong)
    line = str(refused.value)
    assert all(cause in line for cause in ("slopes are those", "LED 2 is darker", "light of the"))
    assert line.endswith("no height follows; `force`=true goes on all the same")
    assert len(told(**wrong, force=True)) == 1
    assert judged(**wrong, force=True)["trust"] < 0.02


def test_two_of_three_are_no_refusal_but_both_of_two_are_if_they_fail_by_much() -> None:
    assert len(told(4 * LIMIT, rest=0.7, light=1.0)) == 1
    with pytest.raises(InputError, match="no height follows"):
        judged(4 * LIMIT, rest=0.7)
    # As `paper` on a right touch of a real sensor, an LED of which has drifted.
    assert len(told(1.1 * LIMIT, rest=0.93)) == 1


def test_walls_under_near_leds_are_allowed_more_than_under_far_ones() -> None:
    """The rough height of a rim in shadow is uncertain, and the light depends on it."""
    near = np.array([[20, 0, 25], [0, 20, 25], [-20, 0, 25], [0, -20, 25]], np.float32)
    departure, used = np.full(SHAPE, 16, np.float32), np.full(SHAPE, 0b0111, np.uint8)
    given = {"departure": departure, "slope": SLOPE, "misfit": EXACT, "used": used, "matt": REST}
    found = touch_evidence(HEIGHT, REST, HEIGHT + np.float32(3), **given)

    def light_check(lights: F4) -> float:
        return judge_touch(found, FilmErrors(lights), force=True)["check_light"]

    assert light_check(near) < 0.5 * light_check(20 * near)


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1)])
def test_an_image_of_a_few_cells_has_a_verdict(shape: tuple[int, int]) -> None:
    untested, level = np.full(shape, -1, np.float32), np.zeros(shape, np.float32)
    found = touch_evidence(untested, np.ones((4, *shape), np.float32), level)
    assert judge_touch(found)["trust"] > 0.9


def dome(wall: float, gap: int = 0) -> dict[str, F4]:
    """A plateau of 0.5 mm behind a wall of such a slope, with a gentle ramp in place of some."""
    y, x = np.indices(SHAPE)
    away = np.hypot(x - 20, y - 15)
    height, slope = np.where(away < 9, 0.5, 0).astype(np.float32), np.zeros((2, *SHAPE), np.float32)
    slope[0][(away >= 7) & (away < 9) & (np.abs(y - 15) >= gap)] = wall
    return {"height": height, "slope": slope, "shadow": np.zeros(SHAPE, np.uint8)}


def rims_of(made: dict[str, F4]) -> U1:
    return rim_cells(made["slope"], made["shadow"])


def share(made: dict[str, F4]) -> float:
    return film_on_rims(made["height"], rims_of(made), REST).share


def test_what_rims_close_in_hangs_on_them() -> None:
    assert share(dome(3.0)) == 1
    assert share(dome(1.1)) == 0, "cells show slopes that turn so little"
    assert 0.2 < share(dome(3.0, gap=2)) < 0.5, "a way up beside the rim measures the top"
    shaded = dome(1.1)
    shaded["shadow"][shaded["slope"][0] > 0] = 0b0101
    assert share(shaded) == 1
    assert share(shaded | {"height": HEIGHT, "slope": 0 * SLOPE}) == 0, "nothing is touched"


def test_what_hangs_on_rims_is_marked_on_the_pixels() -> None:
    like = np.zeros((1, 4 * SHAPE[0] - 1, 4 * SHAPE[1] - 1), np.float32)
    steep, gentle = dome(3.0), dome(1.1)
    marked = film_on_rims(steep["height"], rims_of(steep), like).film
    assert marked.shape == like.shape[1:]
    assert np.array_equal(marked[2::4, 2::4], steep["height"] > 0)
    assert not film_on_rims(gentle["height"], rims_of(gentle), like).film.any()
    lens = np.array([-0.1, 0, 0, 0, 0, 0, 0, 0], np.float32)
    seen = film_on_rims(steep["height"], rims_of(steep), like, lens).film
    true = marked[nearest_ideal(lens, marked.shape)]
    assert np.count_nonzero(seen != true) < 0.05 * np.count_nonzero(true)


@pytest.mark.parametrize(("hanging", "measured", "told"), [(0.5, 0, 1), (0.5, 1, 0), (0.2, 0, 0)])
def test_rims_are_a_warning_unless_something_else_measures_them(
    hanging: float, measured: bool, told: bool
) -> None:
    notes: list[str] = []
    with collect_warnings(notes):
        found = judged(0.0, rim_share=hanging, rims_measured=measured)
    assert found["rim_share"] == hanging
    assert notes == [note for note in notes if "50% of the touch hangs on rims" in note]
    assert len(notes) == told
