"""Frames are matched to LEDs, and what is no frame of one LED is found out."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.rings.frames.rest_film import RestFilm, cells, make_film
from tactograph.rings.live.nodes.simulated.simulated_sensor import Scene, SimulatedSensor
from tactograph.rings.live.nodes.touches._match_frames import Matcher, Verdict
from tactograph.rings.live.nodes.touches.led_in_frame import reach, see

ROWS, COLUMNS = 120, 160
RATE = 30.0
FRAME = 1 / RATE
RIGS = {"near": (33.0, 60.0), "far": (28.0, 380.0)}
PRESSES = (0.0, 1.5, 2.7, 4.0, 5.6)
"""Moments: the ball goes down until 4 s and round the film all the time."""


@cache
def sensor(rig: str = "near") -> SimulatedSensor:
    slant, distance = RIGS[rig]
    scene = Scene(
        width_px=COLUMNS, height_px=ROWS, pixel_size_mm=1 / 7, slant_deg=slant,
        distance_mm=distance, radius_mm=5.0, depth_mm=1.5, path_mm=4.0,
    )  # fmt: skip
    return SimulatedSensor(scene, start=0.0)


@cache
def film(rig: str = "near") -> RestFilm:
    """As a calibration has it: the untouched film, many frames averaged."""
    rest = [np.mean([frame(k, 0.0, rig=rig, number=n) for n in range(8)], axis=0) for k in LEDS]
    return make_film(np.stack(rest).astype(np.float32) / 255)


LEDS = (1, 2, 3, 4)


def frame(led: int, moment: float, rig: str = "near", number: int = 0, **shares: F4) -> F4:
    """A frame under one LED (0: none), or under `shares` of several, by name k1 ... k4."""
    rows = {f"k{led}": np.ones(ROWS, np.float32), **shares}
    none = np.zeros(ROWS, np.float32)
    return sensor(rig).image([rows.get(f"k{k}", none) for k in LEDS], moment, number)


def falling(start: float, end: float) -> F4:
    """Shares of the rows: 1 above `start`, 0 below `end`, both as shares of the height."""
    rows = (np.arange(ROWS) + 0.5) / ROWS
    return np.clip((end - rows) / (end - start), 0, 1).astype(np.float32)


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("moment", PRESSES)
@pytest.mark.parametrize("led", LEDS)
def test_an_led_is_known_by_the_film_around_the_touch(rig: str, moment: float, led: int) -> None:
    sight = see(frame(led, moment, rig), film(rig))
    assert (sight.kind, sight.led) == ("one", led)
    assert sight.gain == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("moment", PRESSES)
@pytest.mark.parametrize("second", [2, 3, 4])
@pytest.mark.parametrize(("start", "end"), [(0.2, 0.201), (0.7, 0.701), (0.3, 0.8)])
def test_two_leds_in_one_frame_are_found_out(
    rig: str, moment: float, second: int, start: float, end: float
) -> None:
    first = falling(start, end)
    both = frame(1, moment, rig, k1=first, **{f"k{second}": 1 - first})
    assert see(both, film(rig)).kind == "mixed"


@pytest.mark.parametrize("share", [0.06, 0.3, 0.5])
def test_two_leds_in_all_rows_are_found_out(share: float) -> None:
    """What a camera without a rolling shutter makes of a change of LED."""
    level = np.full(ROWS, share, np.float32)
    sight = see(frame(1, 2.7, k1=1 - level, k2=level), film())
    assert sight.kind == "mixed"
    assert {sight.led, sight.other} == {1, 2}


def test_an_led_that_lights_some_rows_only_is_found_out() -> None:
    assert see(frame(1, 2.7, k1=falling(0.4, 0.9)), film()).kind == "mixed"


def test_a_dimmer_led_is_still_that_led() -> None:
    sight = see(frame(1, 2.7, k1=np.full(ROWS, 0.7, np.float32)), film())
    assert (sight.kind, sight.led) == ("one", 1)
    assert sight.gain == pytest.approx(0.7, abs=0.02)


def test_pictures_that_do_not_show_the_film() -> None:
    rng = np.random.default_rng(1)
    assert see(frame(0, 2.7), film()).kind == "off"
    assert see(np.full((ROWS, COLUMNS), 255, np.uint8), film()).kind == "saturated"
    assert see(frame(1, 2.7)[:-2], film()).kind == "wrong size"
    cloth = rng.integers(40, 200, (ROWS // 8, COLUMNS // 8)).astype(np.uint8)
    assert see(np.kron(cloth, np.ones((8, 8), np.uint8)), film()).kind in ("covered", "unclear")


def test_sixteen_bits_say_the_same() -> None:
    deep = frame(3, 2.7).astype(np.uint16)
    assert see(deep * 257, film()).led == 3
    assert see(deep * 16, film(), full=4095).led == 3


Clock = Callable[[float], int | None]


def clock(delay: float = 0.0, cycle: tuple[int, ...] = LEDS) -> Clock:
    """A controller's clock; frame n ends `delay` after its LED's step has passed its middle."""
    return lambda time: cycle[int(np.floor((time - delay) * RATE)) % len(cycle)]


def matcher(known: Clock | None = None, cycle: tuple[int, ...] = LEDS) -> Matcher:
    return Matcher(film(), cycle, RATE, known)


def play(
    matcher: Matcher, numbers: range, image_of: Callable[[int], int] = lambda n: n % 4 + 1
) -> list[Verdict]:
    """Frame n ends at (n + 1/2) frame times and shows LED `image_of(n)`."""
    moments = [(n + 0.5) * FRAME for n in numbers]
    return [
        matcher.match(frame(image_of(n), moment, number=n), moment)
        for n, moment in zip(numbers, moments, strict=True)
    ]


def faults(verdicts: list[Verdict]) -> list[str]:
    return [verdict.fault for verdict in verdicts if verdict.fault]


@pytest.mark.parametrize("known", [None, clock(), clock(0.021), clock(-0.09)])
def test_frames_in_their_turn_are_all_taken(known: Clock | None) -> None:
    """However late the camera's times are against the controller's."""
    verdicts = play(matcher(known), range(24))
    assert [verdict.led for verdict in verdicts] == [n % 4 + 1 for n in range(24)]


def test_swapped_frames_are_discarded() -> None:
    matching = matcher(clock())
    play(matching, range(12))
    verdicts = play(matching, range(12, 20), lambda n: {12: 2, 13: 1}.get(n, n % 4 + 1))
    assert faults(verdicts) == ["swapped", "late"]
    assert [v.led for v in verdicts] == [None, None, 3, 4, 1, 2, 3, 4]


def test_a_cycle_that_slipped_is_found_again_within_a_cycle() -> None:
    matching = matcher(clock())
    play(matching, range(12))
    verdicts = play(matching, range(12, 40), lambda n: (n + 1) % 4 + 1)
    assert faults(verdicts) == ["swapped", "swapped", "slipped"]
    assert [v.led for v in verdicts[3:]] == [(n + 1) % 4 + 1 for n in range(15, 40)]


def test_a_frame_that_comes_twice_counts_once() -> None:
    matching = matcher(clock())
    play(matching, range(12))
    again = frame(4, 11.5 * FRAME, number=11)
    assert matching.match(again, 12.5 * FRAME).fault == "doubled"
    assert not faults(play(matching, range(13, 20)))


@pytest.mark.parametrize("known", [None, clock()])
def test_a_burnt_out_led_is_named_and_counts_as_dark(known: Clock | None) -> None:
    matching = matcher(known)
    play(matching, range(12))
    verdicts = play(matching, range(12, 36), lambda n: 0 if n % 4 == 1 else n % 4 + 1)
    assert {verdict.about for verdict in verdicts if verdict.fault} == {2}
    assert faults(verdicts) == ["dark", "dark", *["burnt out"] * 4]
    assert [v.led for v in verdicts[-4:]] == [1, 2, 3, 4]
    play(matching, range(36, 44))
    assert not matching.burnt


def test_no_led_is_burnt_out_when_all_are_dark() -> None:
    matching = matcher(clock())
    play(matching, range(12))
    verdicts = play(matching, range(12, 40), lambda n: 0)
    assert all(verdict.led is None for verdict in verdicts)
    assert set(faults(verdicts[8:])) == {"covered"}
    assert not matching.burnt
    assert not faults(play(matching, range(40, 48)))


@pytest.mark.parametrize("known", [None, clock(cycle=(1, 2, 3, 4, 0))])
def test_the_ambient_step_is_found_and_its_light_taken_off(known: Clock | None) -> None:
    cycle = (1, 2, 3, 4, 0)
    matching = matcher(known, cycle)
    lamp = np.random.default_rng(0).uniform(0.1, 0.2, (ROWS, 1)) * 255
    found = []
    for n in range(25):
        moment = (n + 0.5) * FRAME
        data = frame(cycle[n % 5], moment, number=n)
        lit = np.clip(data * 0.8 + lamp, 0, 254).astype(np.uint8)
        found.append(matching.match(lit, moment).led)
    assert found[10:] == [cycle[n % 5] for n in range(10, 25)]


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("moment", [0.0, 2.7])
@pytest.mark.parametrize("second", [2, 4])
def test_a_fiftieth_of_a_neighbours_light_shows_in_its_pattern(
    rig: str, moment: float, second: int
) -> None:
    """So little of it tilts the whole height map by tens of microns."""
    rest = film(rig)
    part = np.full(ROWS, 0.02, np.float32)
    both = frame(1, moment, rig, k1=1 - part, **{f"k{second}": part})
    found = reach(cells(both) / 255 - rest.dark, rest.patterns, 1, before=4, after=2)
    assert found == pytest.approx(0.02 if second == 2 else -0.02, abs=0.01)
    alone = frame(1, moment, rig)
    none = reach(cells(alone) / 255 - rest.dark, rest.patterns, 1, before=4, after=2)
    assert abs(none) < 0.01
