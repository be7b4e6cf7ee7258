"""Draw a sketch as SVG: columns from sources to sinks, a box a step, a curve an edge.

Steps of a group's use stand together in a frame.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import NamedTuple

from tactograph.graph.show.sketch import Edge, Sketch
from tactograph.graph.show.svg import (
    ARROW_TIP,
    DASHED_LINE,
    HEIGHT_PX,
    MARGIN_PX,
    WIDTH_PX,
    drawing,
    drawn_box,
    drawn_edge,
)

COLUMN_PX, ROW_PX = 210, 52
"""Distance from one box to the next."""
HEAD_PX, PAD_PX = 18, 6
"""Height of a frame's name, and the space around the steps in it."""


def to_svg(sketch: Sketch, times: Mapping[str, float] | None = None) -> str:
    """The sketch as an SVG image, boxes coloured by back end, with `times` in ms where known.

    The ``data-node`` of a box names its step.
    """
    column = _columns(sketch)
    whole = _lay_out("", column, {box.name: box.use for box in sketch.boxes}, sketch.edges)
    at = {n: (MARGIN_PX + COLUMN_PX * column[n], MARGIN_PX + y) for n, y in whole.steps.items()}
    right = max((x for x, _ in at.values()), default=0) + WIDTH_PX + MARGIN_PX
    bottom = whole.height + 0.08 * right + 2 * MARGIN_PX
    lines = [_drawn_frame(use, frame) for use, frame in whole.frames.items()]
    lines += [_edge(at[a], at[b], port, ARROW_TIP) for a, b, port in sketch.edges]
    lines += [
        _edge(at[a], at[b], f"previous {port}", DASHED_LINE + ARROW_TIP)
        for a, b, port in sketch.recalls
    ]
    for box in sketch.boxes:
        title, words = box.name, box.label
        if box.is_transfer:
            title, _, words = box.name.partition(" ")
        if times and times.get(box.name):
            words = f"{words}, {times[box.name]:.2g} ms"
        lines += drawn_box(box, *at[box.name], title, words)
    return drawing(sketch.title, right, bottom, lines)


class _Frame(NamedTuple):
    """The frame around a use: its columns, top and height, and the frames nested in it."""

    first: int
    last: int
    top: int
    height: int
    deep: int


@dataclass
class _Area:
    """The content of a use: the tops of its steps and frames, from its own top."""

    steps: dict[str, int] = field(default_factory=dict)
    frames: dict[str, _Frame] = field(default_factory=dict)
    height: int = 0


def _columns(sketch: Sketch) -> dict[str, int]:
    """The column of each step: one behind the last step that it reads."""
    before = _before(sketch.edges)
    column: dict[str, int] = {}
    for box in sketch.boxes:  # in order: what a step reads comes before it
        column[box.name] = 1 + max((column[a] for a in before.get(box.name, ())), default=-1)
    return column


def _before(joined: Iterable[Edge]) -> dict[str, list[str]]:
    """The steps that each step reads."""
    before: dict[str, list[str]] = {}
    for a, b, _ in joined:
        before.setdefault(b, []).append(a)
    return before


def _lay_out(
    around: str,
    column: Mapping[str, int],
    uses: Mapping[str, str],
    joined: Sequence[Edge],
) -> _Area:
    """Stack the steps of a use, and below them the uses inside it.

    Steps of a column are ordered by the mean place of the steps that they read, so that few edges
    cross.
    """
    before, area = _before(joined), _Area()
    filled: dict[int, int] = {}  # the lower end of the content, by column

    def place_read(name: str) -> float:
        places = [area.steps[a] for a in before.get(name, ()) if a in area.steps]
        return sum(places) / max(len(places), 1)

    own = [name for name, use in uses.items() if use == around]
    for number in sorted({column[name] for name in own}):
        for name in sorted([n for n in own if column[n] == number], key=place_read):
            area.steps[name] = filled.get(number, 0)
            filled[number] = area.steps[name] + ROW_PX
    for use in _inside(around, uses.values()):
        inner = _lay_out(use, column, uses, joined)
        columns = [column[name] for name in inner.steps]
        spanned = range(min(columns), max(columns) + 1)
        top = max(filled.get(number, 0) for number in spanned)
        height = HEAD_PX + inner.height + PAD_PX
        deep = 1 + max((frame.deep for frame in inner.frames.values()), default=0)
        area.frames[use] = _Frame(min(columns), max(columns), top, height, deep)
        for name, frame in inner.frames.items():
            area.frames[name] = frame._replace(top=frame.top + top + HEAD_PX)
        area.steps |= {name: y + top + HEAD_PX for name, y in inner.steps.items()}
        filled |= dict.fromkeys(spanned, top + height + ROW_PX - HEIGHT_PX)
    area.height = max(filled.values(), default=0) - (ROW_PX - HEIGHT_PX)
    return area


def _inside(around: str, uses: Iterable[str]) -> list[str]:
    """The uses that stand directly in another, or in none."""
    prefix = f"{around}." if around else ""
    deeper = [use[len(prefix) :] for use in uses if use.startswith(prefix)]
    names = dict.fromkeys(use.partition(".")[0] for use in deeper if use)
    return [prefix + name for name in names]


def _drawn_frame(use: str, frame: _Frame) -> str:
    x, y = MARGIN_PX + COLUMN_PX * frame.first - PAD_PX * frame.deep, MARGIN_PX + frame.top
    width = COLUMN_PX * (frame.last - frame.first) + WIDTH_PX + 2 * PAD_PX * frame.deep
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{frame.height}" rx="5" fill="#f6f6f6" '
        f'stroke="#999"/><text x="{x + PAD_PX}" y="{y + 13}" fill="#555">{escape(use)}</text>'
    )


def _edge(start: tuple[int, int], end: tuple[int, int], port: str, more: str) -> str:
    x1, y1 = start[0] + WIDTH_PX, start[1] + HEIGHT_PX / 2
    x2, y2 = end[0], end[1] + HEIGHT_PX / 2
    bend = max(30.0, abs(x2 - x1) / 2)
    # An edge that passes other columns hangs below their boxes, which would hide it.
    sag = 0.1 * max(0, x2 - x1 - COLUMN_PX)
    way = f"M{x1} {y1}C{x1 + bend} {y1 + sag} {x2 - bend} {y2 + sag} {x2} {y2}"
    return drawn_edge(way, port, more)
