"""A graph that is tuned, and what tunes it."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tactograph.rings.tune.tuning import State, Tuning
from tests.graph.conftest import Write, tactograph, toys, write

__all__ = ["tactograph", "toys", "write"]

GRAPH = """
format: 1
params: {count: {kind: integer, default: 3}}
nodes:
  frames: {op: touches, with: {count: $count}}
  twice:  {op: doubled, in: {image: frames.image}}
  seen:   {op: noticed, in: {image: twice}}
  high:   {op: bright, in: {image: twice}}
  fail:   {op: failing, in: {image: seen}, with: {at: 99}}
outputs: {light: fail, high: high.light}
"""

Open = Callable[..., Tuning]


def settled(tuning: Tuning) -> State:
    """Wait for the result of the latest request."""
    end = time.monotonic() + 60
    while tuning.state.request is not tuning.request:
        assert time.monotonic() < end, "no result arrived in time"
        time.sleep(0.01)
    return tuning.state


@pytest.fixture
def opened(toys: list[str], write: Write) -> Iterator[Open]:
    made: list[Tuning] = []

    def make(text: str = GRAPH, **more: Any) -> Tuning:
        made.append(Tuning(write(text), {}, **more))
        return made[-1]

    yield make
    for tuning in made:
        tuning.close()


@pytest.fixture
def tuning(opened: Open) -> Tuning:
    return opened()
