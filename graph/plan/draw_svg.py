"""Draw a plan as SVG: columns from sources to sinks, a box a step, a curve an edge."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from tactograph.graph.plan.draft import Task
from tactograph.graph.plan.draw import COLOURS, edges, recalls
from tactograph.graph.plan.plan import Plan, Step

WIDTH, HEIGHT = 150, 34
"""Of a box, in px."""
COLUMN, ROW = 210, 52
"""From one box to the next."""
EDGE = 20


def to_svg(plan: Plan, times: Mapping[str, float] | None = None, *, transfers: bool = True) -> str:
    """The plan as an SVG image, boxes coloured by back end, with `times` in ms where known.

    The group of a node's box says in ``data-node`` which it is.
    """
    times = times or {}
    joined = edges(plan, transfers=transfers)
    steps = [step for step in plan.steps if transfers or step.name in plan.tasks]
    at = _places(steps, joined)
    right = max((x for x, _ in at.values()), default=0) + WIDTH + EDGE
    bottom = max((y for _, y in at.values()), default=0) + HEIGHT + 0.08 * right + EDGE
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right} {bottom}" '
        f'width="{right}" height="{bottom}" font-family="sans-serif" font-size="11">',
        f"<title>{escape(plan.graph.name)}</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0 8 4 0 8z" fill="#777"/></marker></defs>',
        f'<rect width="{right}" height="{bottom}" fill="white"/>',
    ]
    lines += [_edge(at[a], at[b], port, "") for a, b, port in joined]
    dashed = ' stroke-dasharray="4 3"'
    lines += [_edge(at[a], at[b], f"previous {port}", dashed) for a, b, port in recalls(plan)]
    for step in steps:
        task = plan.tasks.get(step.name)
        x, y = at[step.name]
        lines += [
            f'<g data-node="{escape(step.name)}">',
            f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="5" '
            f'fill="{COLOURS[step.backend]}" stroke="#555"/>',
            _text(x + WIDTH / 2, y + 14, step.name if task else step.kind, ' font-weight="bold"'),
            _text(x + WIDTH / 2, y + 27, _words(step, task, times), ""),
            "</g>",
        ]
    return "\n".join([*lines, "</svg>", ""])


def _words(step: Step, task: Task | None, times: Mapping[str, float]) -> str:
    """What a box says below its name."""
    what = task.node.name if task else step.name.split(" ")[-1]
    return f"{what}, {times[step.name]:.2g} ms" if times.get(step.name) else what


def _places(
    steps: Sequence[Step], joined: Iterable[tuple[str, str, str]]
) -> dict[str, tuple[int, int]]:
    """The upper left corner of each step's box.

    A step stands one column behind the last that it reads, and in its column in the order of
    the mean row of those that it reads, so that few edges cross.
    """
    before: dict[str, list[str]] = {step.name: [] for step in steps}
    for a, b, _ in joined:
        before[b].append(a)
    column: dict[str, int] = {}
    for step in steps:  # in order: what a step reads comes before it
        column[step.name] = 1 + max((column[a] for a in before[step.name]), default=-1)
    row: dict[str, int] = {}
    for number in sorted(set(column.values())):
        names = [name for name, its in column.items() if its == number]
        names.sort(key=lambda n: sum(row[a] for a in before[n]) / max(len(before[n]), 1))
        row.update({name: index for index, name in enumerate(names)})
    return {n: (EDGE + COLUMN * column[n], EDGE + ROW * row[n]) for n in column}


def _edge(start: tuple[int, int], end: tuple[int, int], port: str, more: str) -> str:
    x1, y1 = start[0] + WIDTH, start[1] + HEIGHT / 2
    x2, y2 = end[0], end[1] + HEIGHT / 2
    bend = max(30.0, abs(x2 - x1) / 2)
    # What goes past other columns hangs below their boxes, which would hide it.
    sag = 0.1 * max(0, x2 - x1 - COLUMN)
    path = f"M{x1} {y1}C{x1 + bend} {y1 + sag} {x2 - bend} {y2 + sag} {x2} {y2}"
    return (
        f'<path d="{path}" fill="none" stroke="#777"{more} marker-end="url(#tip)">'
        f"<title>{escape(port)}</title></path>"
    )


def _text(x: float, y: float, words: str, more: str) -> str:
    return f'<text x="{x}" y="{y}" text-anchor="middle"{more}>{escape(words)}</text>'
