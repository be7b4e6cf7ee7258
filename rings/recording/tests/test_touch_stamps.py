"""Stamps of touches where the time of day is set meanwhile."""

import time

import pytest

from tactograph.rings.recording.files.stamps import TouchStamps

YEAR_NS = 365 * 24 * 3600 * 10**9


@pytest.mark.parametrize("set_by", [-YEAR_NS, YEAR_NS])
@pytest.mark.parametrize("is_known", [True, False])
def test_those_of_a_recording_go_on_as_they_began(
    monkeypatch: pytest.MonkeyPatch, set_by: int, is_known: bool
) -> None:
    def stamp() -> int:
        return stamps.of(time.monotonic() if is_known else None)

    stamps = TouchStamps()
    first, day = stamp(), time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: day() + set_by)
    assert first <= stamp() < first + YEAR_NS


def test_those_for_other_programs_follow_the_clock_that_these_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stamps = TouchStamps(follow=True)
    day = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: day() + YEAR_NS)
    before = time.time_ns()
    moment = time.monotonic()
    assert abs(stamps.of(moment) - before) < YEAR_NS
    assert stamps.of(None) >= before
