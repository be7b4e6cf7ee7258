"""Draw a sketch as SVG for a page, in layers from top to bottom.

This is the layered drawing of Sugiyama.  A box stands one layer below the last box that it reads.
An edge that passes layers goes through a spot in each, shared by all edges from one box.  Sweeps
move each spot towards the mean of its neighbours, which orders a layer so that few edges cross.
"""

from collections.abc import Iterable, Mapping
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tactograph.graph.backends import BACKENDS
from tactograph.graph.show.sketch import Box, Sketch

if TYPE_CHECKING:
    import networkx as nx

BACKEND_COLOURS: dict[str, str] = {**dict.fromkeys(BACKENDS, "#fbe3c5"), "numpy": "#dbe9f6"}
WIDTH_PX, HEIGHT_PX = 150, 34
"""Size of a box."""
MAX_LETTERS = 21
"""Letters that fit into a box of that width, bold ones too."""
MARGIN_PX = 20
"""Space around the drawing."""
ARROW_TIP = ' marker-end="url(#tip)"'
DASHED_LINE = ' stroke-dasharray="4 3"'
LAYER_GAP_PX = 30
"""Space between two layers."""
BOX_GAP_PX, LANE_PX = 16, 12
"""Space between boxes of a layer, and the width that a passing edge takes."""
RECALL_PX = 60
"""Space at the right for edges to the next item."""
SWEEP_COUNT = 12
"""Passes over all layers, down and up; the later half looks up and down at once."""

Spot = tuple[str, int]
"""A box, or the trunk of edges from it, in a layer."""


def to_svg(sketch: Sketch, times: Mapping[str, float] | None = None) -> str:
    """The sketch as an SVG image, boxes coloured by back end, with `times` in ms where known.

    Its boxes are in an order in which edges lead onwards; ``data-node`` names them.
    """
    layer = _layers(sketch)
    trunks = _trunks(sketch, layer)
    centre = _centres(trunks, layer)
    x_min = min(centre.values(), default=0.0) - WIDTH_PX / 2 - MARGIN_PX
    centre = {spot: x - x_min for spot, x in centre.items()}
    right = max(centre.values(), default=0.0) + WIDTH_PX / 2 + MARGIN_PX
    right += RECALL_PX if sketch.recalls else 0
    bottom = _top(1 + max(layer.values(), default=-1)) - LAYER_GAP_PX + MARGIN_PX
    lines: list[str] = []
    ports: Iterable[str]
    for upper, lower, ports in trunks.edges.data("ports"):
        arrives = upper[0] != lower[0]
        start = centre[upper], _top(upper[1]) + HEIGHT_PX
        end = centre[lower], _top(lower[1]) + (0 if arrives else HEIGHT_PX)
        lines.append(_drawn_segment(start, end, ", ".join(ports), arrives=arrives))
    for a, b, port in sketch.recalls:
        lines.append(_drawn_recall((a, layer[a]), (b, layer[b]), port, centre))
    for box in sketch.boxes:
        spot = box.name, layer[box.name]
        is_use = box.name in sketch.groups
        lines += _drawn_box(box, centre[spot], spot[1], times or {}, is_use=is_use)
    return _drawing(sketch.title, right, bottom, lines)


def _top(layer: int) -> int:
    return MARGIN_PX + layer * (HEIGHT_PX + LAYER_GAP_PX)


def _layers(sketch: Sketch) -> dict[str, int]:
    """The layer of each box; a box that reads none stands just above its first reader."""
    import networkx as nx  # slow, and a run draws nothing

    graph = nx.DiGraph((a, b) for a, b, _ in sketch.edges)
    graph.add_nodes_from(box.name for box in sketch.boxes)
    rows = enumerate(nx.topological_generations(graph))
    layer = {name: number for number, row in rows for name in row}
    first = [name for name in layer if graph[name] and not graph.pred[name]]
    return layer | {name: min(layer[b] for b in graph[name]) - 1 for name in first}


def _trunks(sketch: Sketch, layer: Mapping[str, int]) -> "nx.DiGraph[Spot]":
    """The edges cut at each layer, with their `ports`; edges of one box share segments."""
    import networkx as nx

    trunks: nx.DiGraph[Spot] = nx.DiGraph()
    trunks.add_nodes_from((box.name, layer[box.name]) for box in sketch.boxes)
    for a, b, port in sketch.edges:
        way = [*((a, at) for at in range(layer[a], layer[b])), (b, layer[b])]
        nx.add_path(trunks, way)
        for segment in pairwise(way):
            trunks.edges[segment].setdefault("ports", {})[port] = None
    return trunks


def _centres(trunks: "nx.DiGraph[Spot]", layer: Mapping[str, int]) -> dict[Spot, float]:
    """The middle of each spot in px: near its neighbours, and apart from the spots beside it."""
    from scipy.optimize import isotonic_regression  # slow to load

    width = {s: WIDTH_PX + BOX_GAP_PX if layer[s[0]] == s[1] else LANE_PX for s in trunks}
    rows = [[s for s in trunks if s[1] == number] for number in sorted({*layer.values()})]
    centre: dict[Spot, float] = {}

    def place(row: list[Spot], wanted: Mapping[Spot, float]) -> None:
        """Place a row's spots beside each other, as near as possible to the wanted places."""
        offsets = np.cumsum([width[s] for s in row]) - [width[s] / 2 for s in row]
        free = isotonic_regression([wanted[s] for s in row] - offsets).x
        centre.update(zip(row, (free + offsets).tolist(), strict=True))

    for row in rows:
        place(row, dict.fromkeys(row, 0.0))
    for sweep in range(SWEEP_COUNT):
        up = sweep % 2
        for row in rows[:: -1 if up else 1]:
            wanted = {}
            for spot in row:
                above, below = trunks.pred[spot], trunks.succ[spot]
                both = [*above, *below] if 2 * sweep >= SWEEP_COUNT else [*(below if up else above)]
                near = both or [spot]
                wanted[spot] = sum(centre[s] for s in near) / len(near)
            row.sort(key=wanted.__getitem__)
            place(row, wanted)
    return centre


def _drawn_segment(
    start: tuple[float, float], end: tuple[float, float], ports: str, *, arrives: bool
) -> str:
    (x1, y1), (x2, y2) = start, end
    bend = y1 + LAYER_GAP_PX
    # Across between two layers, then down past boxes; a line of no length would turn the tip.
    past = "" if arrives else f"V{y2}"
    way = f"M{x1:.1f} {y1}C{x1:.1f} {bend - 8} {x2:.1f} {y1 + 8} {x2:.1f} {bend}{past}"
    return _drawn_edge(way, ports, ARROW_TIP if arrives else "")


def _drawn_recall(start: Spot, end: Spot, port: str, centre: Mapping[Spot, float]) -> str:
    x1, y1 = centre[start] + WIDTH_PX / 2, _top(start[1]) + HEIGHT_PX - 8
    x2, y2 = centre[end] + WIDTH_PX / 2, _top(end[1]) + 8
    out = max(x1, x2) + RECALL_PX
    way = f"M{x1:.1f} {y1}C{out:.1f} {y1} {out:.1f} {y2} {x2:.1f} {y2}"
    return _drawn_edge(way, f"previous {port}", DASHED_LINE + ARROW_TIP)


def _drawn_box(
    box: Box, centre: float, layer: int, times: Mapping[str, float], *, is_use: bool
) -> list[str]:
    """A box, coloured by back end, with its time.  A folded use has a broad rim."""
    inside = [ms for node, ms in times.items() if f"{node}.".startswith(f"{box.name}.")]
    name, label = escape(box.name), box.label
    words = f"{label}, {sum(inside):.2g} ms" if any(inside) else label
    rim = ' stroke-width="2.5"' if is_use else ""
    x, top = round(centre - WIDTH_PX / 2, 1), _top(layer)
    middle = f'x="{centre:.1f}" text-anchor="middle"'
    return [
        f'<g data-node="{name}">',
        f'<rect x="{x}" y="{top}" width="{WIDTH_PX}" height="{HEIGHT_PX}" rx="5" '
        f'fill="{BACKEND_COLOURS[box.backend]}" stroke="#555"{rim}/>',
        f'<text {middle} y="{top + 14}" font-weight="bold"{_within(box.name)}>{name}</text>',
        f'<text {middle} y="{top + 27}"{_within(words)}>{escape(words)}</text>',
        "</g>",
    ]


def _within(text: str) -> str:
    """Attributes that squeeze a long text into its box."""
    long = f' textLength="{WIDTH_PX - 10}" lengthAdjust="spacingAndGlyphs"'
    return long if len(text) > MAX_LETTERS else ""


def _drawing(title: str, width: float, height: float, lines: Iterable[str]) -> str:
    """An SVG image of these lines, with an arrow tip that they may use."""
    size = f'width="{width:.0f}" height="{height:.0f}"'
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'{size} font-family="sans-serif" font-size="11">',
        f"<title>{escape(title)}</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="6" '
        'markerHeight="6" orient="auto"><path d="M0 0 8 4 0 8z" fill="#777"/></marker></defs>',
        f'<rect {size} fill="white"/>',
    )
    return "\n".join([*head, *lines, "</svg>", ""])


def _drawn_edge(way: str, ports: str, more: str = "") -> str:
    """A path that shows the names of its ports."""
    path = f'<path d="{way}" fill="none" stroke="#777"{more}>'
    return f"{path}<title>{escape(ports)}</title></path>"
