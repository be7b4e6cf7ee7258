"""Numbers of contacts that move, split, merge and cross."""

from collections.abc import Iterable, Iterator

import numpy as np
import pytest
from scipy.ndimage import label

from tactograph.nodes import U1
from tactograph.rings.mechanics.nodes.motion.follow_contacts import (
    FollowedContacts,
    follow_contacts,
)
from tests.nodes.contact.test_largest_contacts import CONTACT, MAX_MEASURED

SHAPE = (80, 120)
Disc = tuple[float, float, float]
"""x, y, radius in px."""


def contacts(discs: Iterable[Disc]) -> U1:
    """Connected regions, numbered from the top left as `find_contact` might."""
    y, x = np.indices(SHAPE)
    raised = np.zeros(SHAPE, bool)
    for cx, cy, radius in discs:
        raised |= (x - cx) ** 2 + (y - cy) ** 2 < radius**2
    return np.asarray(label(raised)[0], np.uint8)


def follow(frames: Iterable[list[Disc]], patience: int = 3) -> Iterator[FollowedContacts]:
    before: FollowedContacts | None = None
    for discs in frames:
        earlier = (None, None) if before is None else before[:2]
        before = follow_contacts(contacts(discs), 0.1, *earlier, patience=patience)
        yield before


def number_at(found: FollowedContacts, x: float, y: float) -> int:
    return int(found.contact[round(y), round(x)])


def test_speeds_are_those_on_the_film() -> None:
    """Pixels that are wider than long."""
    lens, before = np.array([0, 0, 0, 0, -0.1, 0, 0, 0], np.float32), None
    for t in range(20):
        earlier = (None, None) if before is None else before[:2]
        frame = contacts([(20 + 3.0 * t, 20 + 2.0 * t, 6)])
        before = follow_contacts(frame, 0.1, *earlier, lens)
    assert before is not None
    assert before.figures["contact_speed_x_mm/c1"] == pytest.approx(0.3 / 0.9, abs=0.01)
    assert before.figures["contact_speed_y_mm/c1"] == pytest.approx(0.2 / 1.1, abs=0.01)


def test_a_contact_that_moves_keeps_its_number_and_has_a_velocity() -> None:
    moving = [[(20 + 3.0 * t, 40, 6), (100, 20, 5)] for t in range(20)]
    *_, last = follow(moving)
    assert number_at(last, 77, 40) == number_at(next(iter(follow(moving))), 20, 40)
    number = number_at(last, 77, 40)
    assert last.figures[f"contact_age/c{number}"] == 20
    assert last.figures[f"contact_speed_x_mm/c{number}"] == pytest.approx(0.3, abs=0.01)
    assert last.figures[f"contact_speed_y_mm/c{number}"] == pytest.approx(0, abs=0.01)


def test_an_order_of_finding_that_changes_swaps_nothing() -> None:
    rising = [[(30, 60 - 2.0 * t, 6), (80, 30, 6)] for t in range(25)]
    assert len({number_at(found, 80, 30) for found in follow(rising)}) == 1


@pytest.mark.parametrize(
    ("before", "now", "numbers"),
    [
        ([(30, 40, 6)], [(38, 40, 6)], [1]),
        ([(30, 40, 6)], [(90, 40, 6)], [2]),
        ([(50, 40, 10), (60, 40, 6)], [(46, 40, 9), (68, 40, 5)], [1, 2]),
        ([(46, 40, 9), (68, 40, 5)], [(50, 40, 10), (62, 40, 6)], [1, 1]),
    ],
    ids=["within reach", "beyond", "the larger part of a split", "the larger of a merge"],
)
def test_who_keeps_a_number(before: list[Disc], now: list[Disc], numbers: list[int]) -> None:
    first, second = follow([before, now])
    assert number_at(first, *before[0][:2]) == 1
    assert [number_at(second, x, y) for x, y, _ in now] == numbers


def test_contacts_that_pass_through_one_another_come_out_with_their_own_numbers() -> None:
    crossing = [[(20 + 2.0 * t, 40, 6), (100 - 2.0 * t, 43, 6)] for t in range(38)]
    found = list(follow(crossing, patience=10))
    right = number_at(found[0], 20, 40)
    assert number_at(found[-1], 20 + 2 * 37, 40) == right
    assert number_at(found[-1], 100 - 2 * 37, 43) != right


def test_a_contact_that_is_gone_for_longer_than_its_patience_ends() -> None:
    disc: Disc = (40.0, 40.0, 8.0)
    for gone, age in ((3, 5), (4, 1)):
        other: Disc = (90.0, 20.0, 5.0)
        frames = [[disc, other], *[[other]] * gone, [disc, other]]
        *_, last = follow(frames)
        assert last.figures[f"contact_age/c{number_at(last, 40, 40)}"] == age


def test_nothing_begins_where_nothing_touches() -> None:
    for found in follow([[]] * 5):
        assert found.figures == {}


def numbers_over(frames: int) -> set[tuple[int, ...]]:
    """All triples of numbers of two contacts that pass one another without touching, and of one
    that splits and merges again, while a fourth comes and goes.
    """
    t, rng = np.arange(frames), np.random.default_rng(2)
    wobble = rng.uniform(-1, 1, (len(t), 4))
    way, apart = 25 * np.sin(2 * np.pi * t / 60), 7 + 6 * np.sin(2 * np.pi * t / 90)
    places, stream = list[list[Disc]](), list[list[Disc]]()
    for now, (one, two, three, four) in zip(t, wobble, strict=True):
        larger, smaller = (92 + three - apart[now], 30.0, 8.0), (92 + three + apart[now], 30.0, 5.0)
        passing = (35 + way[now], 14 + one, 6.0), (35 - way[now], 35 + two, 6.0)
        guest: list[Disc] = [(60 + four, 65.0, 7.0)] if now % 200 < 120 else []
        places.append([*passing, larger])
        stream.append([*passing, larger, smaller, *guest])
    return {
        tuple(number_at(found, x, y) for x, y, _ in discs)
        for found, discs in zip(follow(stream), places, strict=True)
    }


@pytest.mark.slow
def test_no_number_is_lost_or_swapped_in_10_000_frames() -> None:
    (numbers,) = numbers_over(10_000)
    assert len({*numbers}) == 3


def test_all_are_followed_but_only_the_largest_have_figures() -> None:
    followed = follow_contacts(CONTACT, 0.1)
    assert np.array_equal(followed.contact > 0, CONTACT > 0)
    assert len({name.rpartition("/")[2] for name in followed.figures}) == MAX_MEASURED
