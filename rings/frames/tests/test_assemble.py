"""Frames of single LEDs become touches."""

import numpy as np
import pytest

from tactograph.rings.frames.assemble import Assembler
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.frames.rest_film import make_film

ROWS, COLUMNS, RATE = 60, 80, 30.0
LEDS = (1, 2, 3, 4)
DARK = np.full((ROWS, COLUMNS), 0.02, np.float32)
FILM = make_film(np.full((4, ROWS, COLUMNS), 0.5, np.float32), DARK)


def frame(number: int, led: int, level: int = 100, dtype: type = np.uint8) -> RawFrame:
    return RawFrame(number, led, number / RATE, np.full((ROWS, COLUMNS), level, dtype))


def assembler(**settings) -> Assembler:
    return Assembler(FILM, DARK, settings.pop("cycle", LEDS), RATE, **settings)


def after_a_cycle(level: int = 100, dtype: type = np.uint8, **settings) -> Assembler:
    """An assembler that has one frame of each LED."""
    assembling = assembler(**settings)
    for n, led in enumerate(LEDS):
        assembling.add(frame(n, led, level, dtype))
    return assembling


def test_a_rolling_touch_comes_with_every_frame_after_one_full_cycle() -> None:
    assembling, due = assembler(), []
    for n in range(10):
        assembling.add(frame(n, n % 4 + 1, 10 * n))
        due.append(assembling.due)
        if assembling.due:
            touch = assembling.take()
    assert due == [False] * 3 + [True] * 7
    assert np.rint(255 * touch[:, 0, 0]).tolist() == [80, 90, 60, 70]
    assert touch.dtype == np.float32
    assert touch.shape == (4, ROWS, COLUMNS)


def test_a_touch_per_cycle_comes_when_all_leds_are_new() -> None:
    assembling, due = assembler(refresh="cycle"), []
    for n in range(12):
        assembling.add(frame(n, n % 4 + 1))
        due.append(assembling.due)
        if assembling.due:
            assembling.take()
    assert [n for n in range(12) if due[n]] == [3, 7, 11]


def test_nothing_is_due_twice() -> None:
    assembling = after_a_cycle()
    assembling.take()
    assert not assembling.due


def test_frames_from_before_a_gap_are_not_mixed_with_those_after_it() -> None:
    assembling = after_a_cycle()
    for n in (30, 31, 32):
        assembling.add(frame(n, n % 4 + 1))
        assert not assembling.due
    assembling.add(frame(33, 2))
    assert assembling.due


def test_ambient_light_is_the_excess_over_the_calibrations_dark() -> None:
    assembling = assembler(cycle=(1, 2, 3, 4, 0))
    assembling.add(frame(0, 0, 51))
    for n, led in enumerate(LEDS, start=1):
        assembling.add(frame(n, led, 153))
    assert assembling.take() == pytest.approx(0.6 - (0.2 - 0.02), abs=1e-6)


@pytest.mark.parametrize("settings", [{"full": 200}, {"cycle": (1, 2, 3, 4, 0)}])
def test_frames_stay_integers_where_they_need_not_be_scaled_or_darkened(settings) -> None:
    touch = after_a_cycle(10, whole=True).take()
    assert touch.dtype == np.uint8
    assert touch[:, 0, 0].tolist() == [10] * 4
    assert after_a_cycle(whole=True, **settings).take().dtype == np.float32
    deep = after_a_cycle(1024, np.uint16, full=4095).take()
    assert deep == pytest.approx(1024 / 4095), "fractions of full scale"


def test_motion_is_how_much_the_light_of_an_led_changes_within_a_cycle() -> None:
    assembling = assembler()
    for n in range(8):
        assembling.add(frame(n, n % 4 + 1))
    assert assembling.motion == 0
    moved = frame(8, 1)
    moved.data[20:24, 30:34] += 26
    assembling.add(moved)
    assert assembling.motion == pytest.approx(26 / 255 / 0.5, rel=0.01)
    for n in range(9, 17):
        assembling.add(frame(n, n % 4 + 1))
    assert assembling.motion == 0
