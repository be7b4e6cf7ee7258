"""Errors of a calibration are reported and attributed to their cause."""

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tactograph.graph import InputError, warn
from tactograph.graph.errors import collect_warnings
from tactograph.graph.files.read_graph import read_graph
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rating.join_doubts import join_doubts
from tactograph.nodes.calibrate.rating.pressed_ball import PressedBall
from tactograph.nodes.calibrate.rating.rate_calibration import LedFit, rate_calibration
from tactograph.nodes.calibrate.rating.ring_doubts import ring_doubts
from tactograph.nodes.calibrate.rating.verdict import Judged
from tactograph.nodes.simulate.light_ring import light_ring

LIGHTS = light_ring(distance_mm=80.0)
GOOD, POOR = np.full(4, 0.01, np.float32), np.full(4, 0.06, np.float32)
SLOPES = np.stack([np.cos(np.arange(64)), np.sin(np.arange(64))], axis=1).astype(np.float32)
MASK = np.ones((4, 6), np.uint8)
FLAT = np.full((4, 4, 6), 0.5, np.float32)


def notes_of(
    residual: F4,
    lights: F4 = LIGHTS,
    noise: float = 0.0,
    flat: F4 = FLAT,
    pixel: float | None = None,
    radius: Judged | None = None,
    other_doubts: list[str] | None = None,
    only_warn: bool = False,
    tables: F4 = GOOD,
    **film: Any,
) -> list[str]:
    variance = np.array([0, noise**2], np.float32)
    with collect_warnings([]) as notes:
        rated = rate_calibration(
            tables, 0.01, SLOPES, MASK, 15 * MASK, LedFit(lights, residual, **film), None, flat,
            variance, pixel, radius, other_doubts, only_warn=only_warn,
        )  # fmt: skip
    assert set(rated.doubts) <= set(notes)
    assert rated.verdict.startswith("doubtful" if rated.doubts else "nothing speaks against it")
    return notes


def test_a_good_calibration_has_no_warning() -> None:
    assert not notes_of(GOOD)


def test_an_error_beyond_the_noise_is_blamed_on_the_ball() -> None:
    (note,) = notes_of(POOR, noise=0.001)
    assert "ball's radius" in note


def test_noise_is_blamed_on_the_exposure() -> None:
    (note,) = notes_of(POOR, noise=0.03)
    assert "expose longer" in note


def test_two_leds_in_one_place_are_named() -> None:
    lights = LIGHTS.copy()
    lights[3] = lights[1]
    (note,) = notes_of(GOOD, lights)
    assert "LEDs 2 and 4" in note


@pytest.mark.parametrize("turn", [[1, 2, 3, 0], [3, 2, 1, 0]], ids=["turned", "clockwise"])
def test_leds_that_are_numbered_around_the_film_raise_no_warning(turn: list[int]) -> None:
    assert not notes_of(GOOD, LIGHTS[turn])


def test_leds_of_a_ring_in_another_order_are_reported_without_a_doubt() -> None:
    (note,) = notes_of(GOOD, LIGHTS[[0, 2, 1, 3]])
    assert "around the film in the order 1, 3, 2, 4" in note
    two_rings = LIGHTS[[0, 2, 1, 3]].copy()
    two_rings[:2, :2] *= 3
    assert not notes_of(GOOD, two_rings)


def test_doubts_of_other_nodes_are_repeated() -> None:
    doubts = join_doubts(["the balls are oval"], [], ["the film is brighter"])
    assert notes_of(GOOD, other_doubts=doubts) == doubts


def test_causes_are_stated_before_their_effects() -> None:
    """A touch in the flat frame looks like bent film, and bent film like an LED that departs."""
    order = list(read_graph("calibrate").nodes["doubts"].inputs)
    assert order.index("flat") < order.index("ring_doubts") < order.index("exposure")


def test_what_a_judge_only_tries_gives_no_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four times "press 1 is left out", with other circles, of bends that were tried."""

    def doubts(*_: object) -> list[str]:
        warn("press 1 is left out")
        return ["the film is bent"]

    judge = SimpleNamespace(load=lambda: SimpleNamespace(doubts=doubts))
    monkeypatch.setattr(
        sys.modules[ring_doubts.function.__module__], "brought", lambda _: {"bend": judge}
    )
    with collect_warnings([]) as notes:
        nothing: Any = None
        assert ring_doubts(nothing, nothing, {}) == ["the film is bent"]
    assert not notes


def test_an_ordinary_film_raises_no_warning() -> None:
    assert not notes_of(GOOD, pixel=3.0, albedo=0.7)


FAR_AWAY = LIGHTS * np.float32(1e4)


OTHER_RADIUS = Judged({}, ["another radius explains the light better"])


@pytest.mark.parametrize(("size", "distance"), [(1.0, "800"), (1e-6, "0.0008")])
def test_leds_at_infinity_are_blamed_on_a_radius_that_is_doubted(
    size: float, distance: str
) -> None:
    film = {"pixel": 3.0 * size, "albedo": 0.0}
    with pytest.raises(
        InputError, match=f"LED 1 is found {distance} m from the film.*ball's radius"
    ):
        notes_of(GOOD, FAR_AWAY * np.float32(size), radius=OTHER_RADIUS, **film)
    with pytest.raises(InputError, match="m from the film"):
        notes_of(POOR, FAR_AWAY * np.float32(size), **film)


def test_parallel_light_that_explains_the_ball_is_accepted() -> None:
    assert not notes_of(GOOD, FAR_AWAY, pixel=3.0, albedo=0.0)


def test_a_film_that_returns_all_light_is_blamed_on_the_radius_and_refused() -> None:
    with pytest.raises(InputError, match=r"albedo is found as 0\.95.*`only_warn`=true"):
        notes_of(GOOD, pixel=3.0, albedo=0.95)


def test_a_forced_calibration_is_doubtful() -> None:
    notes = notes_of(GOOD, FAR_AWAY, pixel=3.0, albedo=0.0, only_warn=True, radius=OTHER_RADIUS)
    assert "LED 1 is found 800 m from the film" in notes[-1]


def test_a_large_held_out_error_is_named_first() -> None:
    notes = notes_of(POOR, noise=0.001, radius=Judged({"film_heldout_deg": 25.0}, []))
    assert "25.0 degrees off" in notes[0]


def test_light_that_the_film_explains_need_not_be_smooth() -> None:
    """A right calibration of a film with a gloss of 0.15 was doubted as of a wrong radius."""
    assert not notes_of(GOOD, noise=0.001, tables=POOR)


def test_a_flat_frame_is_asked_for_only_where_there_is_none() -> None:
    taken = FLAT + np.linspace(0, 0.1, 6, dtype=np.float32)
    assert "`flat`=DIR" in notes_of(POOR, noise=0.001)[0]
    assert "`flat`=DIR" not in notes_of(POOR, noise=0.001, flat=taken)[0]


def test_a_flat_frame_that_was_not_taken_is_not_noisy() -> None:
    """Its level of 1 was once taken for saturated light, of which nothing is known."""
    assert not any("noisy" in note for note in notes_of(0 * POOR, noise=0.003, flat=0 * FLAT + 1))
    assert any("noisy" in note for note in notes_of(0 * POOR, noise=0.3, flat=0 * FLAT + 1))


def test_a_press_that_no_other_can_check_is_reported_in_words() -> None:
    """It was "nan degrees off"."""
    beside = np.array([-40.0, 5.0, 4.0])
    angle, *_ = PressedBall(beside, 20.0, 0.1).errors(np.zeros((2, 9, 9)), np.zeros((9, 9)))
    (doubt,) = Judged.of_heldout("film_heldout_deg", angle).doubts
    assert doubt.startswith("no press could be checked by the others")
