"""The ties of a device's networks, and the order in which they are joined."""

from itertools import pairwise

import numpy as np
from hypothesis import given, strategies as st

from tactograph.nodes.height.height_levels import levels_of, tie_levels
from tactograph.nodes.height.springs import Ties, join_ends, stable_order

ROWS, COLUMNS = 40, 50


@given(st.lists(st.integers(0, 5) | st.integers(2**57, 2**62), max_size=40))
def test_equal_keys_keep_their_order(keys: list[int]) -> None:
    numbers = np.array(keys, np.int64)
    assert stable_order(numbers).tolist() == np.argsort(numbers, kind="stable").tolist()


@given(st.lists(st.tuples(*[st.integers(0, ROWS * COLUMNS - 1)] * 2), max_size=60))
def test_coarser_ties_join_those_between_the_same_blocks(
    ends: list[tuple[int, int]],
) -> None:
    """Level after level, as on the host; a tie within a block disappears."""
    top, foot = np.array(ends, np.int64).reshape(-1, 2).T
    levels = levels_of(ROWS, COLUMNS)
    found = tie_levels(Ties(top, foot, np.ones(top.size, np.float32)), levels)
    members = [set(part.tolist()) for part in np.split(found.members, found.member_start[1:-1])]
    tops, feet = {}, {}
    for own, tie in zip(found.knot_own, found.knot_tie, strict=True):
        (tops if tie >= 0 else feet)[int(tie if tie >= 0 else ~tie)] = int(own)
    expected = [({t}, levels[0].at(top[t]), levels[0].at(foot[t])) for t in range(top.size)]
    which = np.arange(top.size)
    for finer, level in pairwise(levels):
        top, foot, joined = join_ends(top, foot, finer.columns, (level.rows, level.columns))
        which = np.where(which >= 0, np.append(joined, -1)[which], -1)
        for tie in range(top.size):
            own = set(np.flatnonzero(which == tie).tolist())
            expected.append((own, level.at(top[tie]), level.at(foot[tie])))
    if expected:
        assert [(members[t], tops[t], feet[t]) for t in range(len(expected))] == expected
    assert found.knot_own.tolist() == sorted(found.knot_own.tolist())
