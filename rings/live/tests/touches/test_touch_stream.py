"""What a stream says while it finds the phase of camera and LEDs, and afterwards."""

from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.rings.frames.rest_film import make_film
from tactograph.rings.live.nodes.camera.camera import Shot
from tactograph.rings.live.nodes.touches._match_frames import Verdict
from tactograph.rings.live.nodes.touches.fault_log import FAULT_LINES
from tactograph.rings.live.nodes.touches.touch_stream import (
    CLEAN_CYCLES,
    MAX_SEARCH_CYCLES,
    SEARCH_MESSAGE,
    Stream,
)

CYCLE = (1, 2, 3, 4)
SHAPE = (60, 80)
MIXED = Verdict(None, "mixed", 2, 3, 0.3)
DIM = Verdict(1, gain=0.8)
MessagesOf = Callable[..., list[str]]


@pytest.fixture
def stream() -> Stream:
    dark = np.zeros(SHAPE, np.float32)
    lamps = SimpleNamespace(clock=None, faults=Counter(), starts=0, news=list)
    camera = SimpleNamespace(faults=Counter(), refused=[], connections=1)
    film = make_film(np.ones((4, *SHAPE), np.float32))
    sensor: Any = SimpleNamespace(cycle=CYCLE, rate=30.0, lamps=lamps, camera=camera)
    return Stream(sensor, film, dark)


@pytest.fixture
def messages_of(stream: Stream, monkeypatch: pytest.MonkeyPatch) -> MessagesOf:
    numbers = iter(range(10**6))

    def take(*verdicts: Verdict) -> list[str]:
        """The messages that such frames cause."""
        notes: list[str] = []
        for verdict in verdicts:
            number = next(numbers)
            monkeypatch.setattr(stream._matcher, "match", lambda *_, verdict=verdict: verdict)
            with collect_warnings(notes):
                stream._take(Shot(number, number / 30, np.full(SHAPE, 99, np.uint8)))
                stream._log.tell(with_item=True)
        return notes

    return take


def in_turn(cycles: int) -> list[Verdict]:
    return [Verdict(led) for led in CYCLE * cycles]


def test_the_search_for_the_phase_is_one_line(stream: Stream, messages_of: MessagesOf) -> None:
    assert messages_of(MIXED, MIXED, MIXED._replace(about=3), DIM, MIXED) == [SEARCH_MESSAGE]
    assert stream.state.faults == {"mixed": 4, "brightness": 1}
    assert messages_of(*in_turn(CLEAN_CYCLES)) == []
    assert messages_of(MIXED) == [FAULT_LINES["mixed"].format(led=2)], "this is no search any more"


def test_a_lasting_fault_gives_a_warning(messages_of: MessagesOf) -> None:
    assert messages_of(*[MIXED] * len(CYCLE) * MAX_SEARCH_CYCLES) == [SEARCH_MESSAGE]
    assert messages_of(MIXED, DIM) == [
        FAULT_LINES["mixed"].format(led=2),
        FAULT_LINES["brightness"].format(led=1),
    ]


def test_a_frame_that_is_lit_in_part_is_in_no_touch_while_the_phase_is_found(
    stream: Stream, messages_of: MessagesOf
) -> None:
    messages_of(DIM, Verdict(2), Verdict(3), Verdict(4))
    assert not stream._assembler.due
    messages_of(Verdict(1))
    assert stream._assembler.due


def test_other_faults_are_reported_at_once(messages_of: MessagesOf) -> None:
    assert messages_of(Verdict(None, "saturated")) == [FAULT_LINES["saturated"]]
