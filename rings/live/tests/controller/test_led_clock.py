"""The controller's clock as the host sees it, by times that nobody waits for."""

import pytest

from tactograph.rings.live.nodes.controller._led_clock import Clock

APART = 1000.0
"""Seconds by which the host's clock is ahead of the controller's."""


def is_heard(clock: Clock, at: float, *, jump: float = 0.0) -> bool:
    """One question at a time of the host, and its answer 2 ms later."""
    return clock.hear(at + 0.001 - APART + jump, at + 0.002, at)


@pytest.fixture
def clock() -> Clock:
    clock = Clock()
    assert all(is_heard(clock, 5000 + 0.2 * i) for i in range(5))
    return clock


def test_a_clock_is_known_to_half_the_time_of_a_question(clock: Clock) -> None:
    assert clock.controller(5001.0) == pytest.approx(5001.0 - APART, abs=clock.error)
    assert clock.error == pytest.approx(0.001, abs=1e-4)


@pytest.mark.parametrize("jump", [0.957, -0.957, 1e9])
def test_a_single_contradicting_time_is_ignored(clock: Clock, jump: float) -> None:
    assert not is_heard(clock, 5001.2, jump=jump)
    assert is_heard(clock, 5001.4)
    assert not is_heard(clock, 5001.6, jump=jump)
    assert clock.controller(5001.6) == pytest.approx(5001.6 - APART, abs=0.002)
    assert clock.error < 0.002


@pytest.mark.parametrize("jump", [3600.0, -3600.0])
def test_a_clock_that_jumped_for_good_is_followed(clock: Clock, jump: float) -> None:
    assert not is_heard(clock, 5001.2, jump=jump)
    assert is_heard(clock, 5001.4, jump=jump)
    assert clock.controller(5001.4) == pytest.approx(5001.4 - APART + jump, abs=0.002)
    assert clock.error < 0.002


def test_the_worst_allowed_quartz_contradicts_nothing() -> None:
    clock = Clock()
    assert all(is_heard(clock, 0.2 * i, jump=2e-4 * 0.2 * i) for i in range(200))
