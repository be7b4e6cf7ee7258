"""Few cases of a node in which any two choices meet."""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

from tactograph.graph.backends.parity_cases import (
    CASE_SHAPES,
    Case,
    _absences,
    _demands,
    _fills,
    _fits,
    _levels,
    _middle,
    _sizes,
)
from tactograph.graph.declare.node import Node


def pairwise(node: Node, shapes: tuple[tuple[int, int], ...] = CASE_SHAPES) -> list[Case]:
    """Make few cases of a node in which any two choices meet.

    Choices are the shape, the fill, each parameter's values, the inputs that are absent and the
    outputs that are wanted.  Choices that do not fit, such as a window larger than the image,
    never meet.
    """
    levels, middle = _levels(node), _middle(shapes)
    axes: list[Sequence[Any]] = [
        [middle, *(shape for shape in shapes if shape != middle)],
        _fills(node),
        [(), *_absences(node)],
        [None, *_demands(node)],
        *levels.values(),
    ]

    def chosen(row: Sequence[int]) -> Case | None:
        shape, fill, omitted, wanted, *values = (axis[n] for axis, n in zip(axes, row, strict=True))
        named = dict(zip(levels, values, strict=True))
        setting = {name: value for name, (_, value) in named.items()}
        if not _fits(node, shape, setting):
            return None
        words = [f"{name}={label}" for name, (label, _) in named.items() if label != "default"]
        words += [f"without {' and '.join(omitted)}"] if omitted else []
        words += [f"only {' and '.join(wanted)}"] if wanted else []
        sizes = _sizes(node, shape, setting)
        return Case(sizes, fill, " ".join(words) or "default", setting, omitted, wanted)

    return list(_covering([len(axis) for axis in axes], chosen))


def _covering(sizes: list[int], chosen: Callable[[Sequence[int]], Case | None]) -> Iterator[Case]:
    """Choose one case after another until any two numbers of two axes have met.

    Each begins with a pair that has not met.  The other axes take the number that meets most new
    pairs, or else their first.
    """
    ends = combinations(range(len(sizes)), 2)
    unmet = {((a, i), (b, j)) for a, b in ends for i in range(sizes[a]) for j in range(sizes[b])}

    def gain(row: list[int]) -> int:
        return len(unmet.intersection(combinations(enumerate(row), 2)))

    while unmet:
        pair = dict(min(unmet))
        row = [pair.get(axis, 0) for axis in range(len(sizes))]
        unmet.discard(min(unmet))
        for axis in set(range(len(sizes))) - set(pair):
            tries = [[*row[:axis], number, *row[axis + 1 :]] for number in range(sizes[axis])]
            row = max((tried for tried in tries if chosen(tried)), key=gain, default=row)
        case = chosen(row)
        if case is not None:
            unmet -= set(combinations(enumerate(row), 2))
            yield case
