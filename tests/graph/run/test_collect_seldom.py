"""A process collects garbage seldom, still finds it, and does not search for it at its end."""

import gc
import weakref
from collections.abc import Iterator

import pytest

from tactograph.graph.run.collect_seldom import MIDDLE_THRESHOLD, YOUNG_THRESHOLD, collect_seldom
from tests.fixtures import python


@pytest.fixture
def thresholds() -> Iterator[None]:
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


class Knot:
    """Garbage that counting references does not find."""

    def __init__(self) -> None:
        self.self = self


def test_garbage_is_still_found(thresholds: None) -> None:
    collect_seldom()
    first = weakref.ref(Knot())
    # Objects that live on are counted, immediate garbage is not.
    live = [[] for _ in range(2 * YOUNG_THRESHOLD)]
    assert first() is None, len(live)


def test_an_old_object_is_collected_once_it_is_garbage(thresholds: None) -> None:
    collect_seldom()
    # What was allocated before counts, too.
    gc.collect()
    knot = Knot()
    live: list[list[int]] = [[] for _ in range(2 * YOUNG_THRESHOLD)]
    old = weakref.ref(knot)
    del knot
    live += [[] for _ in range(YOUNG_THRESHOLD * (MIDDLE_THRESHOLD + 2))]
    assert old() is None


ENDS = """
import atexit, gc
atexit.register(lambda: print(len(gc.get_objects()), gc.get_freeze_count()))
from tactograph.graph.run.collect_seldom import collect_seldom
collect_seldom()
"""


def test_a_process_that_ends_examines_no_objects() -> None:
    examined, frozen = map(int, python("-c", ENDS).stdout.split())
    assert examined < 100 < frozen
