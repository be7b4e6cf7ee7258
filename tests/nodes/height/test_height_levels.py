"""The ties of a device's networks, and the order in which they are joined."""

from itertools import pairwise

import numpy as np
from hypothesis import given, strategies as st

from tactograph.nodes.height.height_levels import levels_of, tie_levels
from tactograph.nodes.height.springs import Ties

ROWS, COLUMNS = 40, 50


@given(st.lists(st.tuples(*[st.integers(0, ROWS * COLUMNS - 1)] * 2), max_size=60))
def test_coarser_ties_join_those_between_the_same_blocks(
    ends: list[tuple[int, int]],
) -> None:
    """Level after level, as the host joins them; a tie within a block is dropped."""
    top, foot = np.array(ends, np.int64).reshape(-1, 2).T
    levels, ties = levels_of(ROWS, COLUMNS), Ties(top, foot, np.ones(top.size, np.float32))
    tied = tie_levels(ties, levels)
    members = [set(part.tolist()) for part in np.split(tied.members, tied.member_start[1:-1])]
    tops, feet = {}, {}
    for knot, tie in zip(tied.knot_own, tied.knot_tie, strict=True):
        (tops if tie >= 0 else feet)[int(tie if tie >= 0 else ~tie)] = int(knot)
    expected = [({t}, levels[0].at(top[t]), levels[0].at(foot[t])) for t in range(top.size)]
    which = np.arange(top.size)
    for finer, level in pairwise(levels):
        ties, joined = ties.joined(finer.columns, (level.rows, level.columns))
        which = np.where(which >= 0, np.append(joined, -1)[which], -1)
        for tie in range(ties.top.size):
            parts = set(np.flatnonzero(which == tie).tolist())
            expected.append((parts, level.at(ties.top[tie]), level.at(ties.foot[tie])))
            assert ties.stiffness[tie] == len(parts)
    if expected:
        assert [(members[t], tops[t], feet[t]) for t in range(len(expected))] == expected
    assert tied.knot_own.tolist() == sorted(tied.knot_own.tolist())
