"""Draw a sketch as SVG for a page, in layers from top to bottom.

This is the layered drawing of Sugiyama.  A box stands one layer below the last box that it reads.
An edge that passes layers goes through a spot in each, shared by all edges from one box.  Sweeps
order each layer so that few edges cross, and then move boxes towards their neighbours.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from tactograph.graph.backends import BACKENDS
from tactograph.graph.show.sketch import Box, Edge, Sketch

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
BOX_GAP_PX, LANE_PX = 16, 14
"""Space between boxes of a layer, and the width that a passing edge takes."""
RECALL_PX = 60
"""Space at the right for edges to the next item."""
ORDER_SWEEPS = 12
"""Passes over all layers, down and up, that order and move boxes."""

Spot = tuple[str, int]
"""A box, or the trunk of edges from it, in a layer."""
Segments = Mapping[tuple[Spot, Spot], str]
"""The parts of edges between two layers, with their ports."""
Joined = dict[Spot, tuple[list[Spot], list[Spot]]]
"""The spots that each spot is joined to, above and below."""


def to_svg(sketch: Sketch, times: Mapping[str, float] | None = None) -> str:
    """The sketch as an SVG image, boxes coloured by back end, with `times` in ms where known.

    Its boxes are in an order in which edges lead onwards; ``data-node`` names them.
    """
    layer = _layers(sketch.boxes, sketch.edges)
    segments = _segments(layer, sketch.edges)
    layers = _ordered(layer, segments)
    centre = _centres(layers, layer, segments)
    x_min = min((x for x in centre.values()), default=0.0) - WIDTH_PX / 2 - MARGIN_PX
    centre = {spot: x - x_min for spot, x in centre.items()}
    right = max(centre.values(), default=0.0) + WIDTH_PX / 2 + MARGIN_PX
    right += RECALL_PX if sketch.recalls else 0
    bottom = 2 * MARGIN_PX + len(layers) * (HEIGHT_PX + LAYER_GAP_PX) - LAYER_GAP_PX
    lines: list[str] = []
    for (upper, lower), ports in segments.items():
        arrives = upper[0] != lower[0]
        start = centre[upper], _top(upper[1]) + HEIGHT_PX
        end = centre[lower], _top(lower[1]) + (0 if arrives else HEIGHT_PX)
        lines.append(_drawn_segment(start, end, ports, arrives=arrives))
    for a, b, port in sketch.recalls:
        lines.append(_drawn_recall((a, layer[a]), (b, layer[b]), port, centre))
    for box in sketch.boxes:
        spot = box.name, layer[box.name]
        is_use = box.name in sketch.groups
        lines += _drawn_box(box, centre[spot], spot[1], times or {}, is_use=is_use)
    return _drawing(sketch.title, right, bottom, lines)


def _top(layer: int) -> int:
    return MARGIN_PX + layer * (HEIGHT_PX + LAYER_GAP_PX)


def _layers(boxes: Sequence[Box], edges: Sequence[Edge]) -> dict[str, int]:
    """The layer of each box; a box that reads none stands just above its first reader."""
    before: dict[str, list[str]] = {}
    after: dict[str, list[str]] = {}
    for a, b, _ in edges:
        before.setdefault(b, []).append(a)
        after.setdefault(a, []).append(b)
    layer: dict[str, int] = {}
    for box in boxes:
        layer[box.name] = 1 + max((layer[a] for a in before.get(box.name, ())), default=-1)
    for box in boxes:
        if box.name not in before and box.name in after:
            layer[box.name] = min(layer[b] for b in after[box.name]) - 1
    return layer


def _segments(layer: Mapping[str, int], edges: Sequence[Edge]) -> dict[tuple[Spot, Spot], str]:
    """The edges cut at each layer, with their ports; edges of one box share segments."""
    segments: dict[tuple[Spot, Spot], dict[str, None]] = {}
    for a, b, port in edges:
        way = [(a, at) for at in range(layer[a], layer[b])] + [(b, layer[b])]
        for spots in itertools.pairwise(way):
            segments.setdefault(spots, {})[port] = None
    return {spots: ", ".join(ports) for spots, ports in segments.items()}


def _neighbours(segments: Segments) -> Joined:
    joined: Joined = {}
    for a, b in segments:
        joined.setdefault(a, ([], []))[1].append(b)
        joined.setdefault(b, ([], []))[0].append(a)
    return joined


def _ordered(layer: Mapping[str, int], segments: Segments) -> list[list[Spot]]:
    """The spots of each layer, ordered by the mean place of their neighbours."""
    spots = dict.fromkeys([(name, at) for name, at in layer.items()])
    spots |= dict.fromkeys(spot for pair in segments for spot in pair)
    layers: list[list[Spot]] = [[] for _ in range(1 + max(layer.values(), default=-1))]
    for spot in spots:
        layers[spot[1]].append(spot)
    joined = _neighbours(segments)
    for sweep in range(ORDER_SWEEPS):
        up = sweep % 2
        for number in range(len(layers))[:: -1 if up else 1]:
            near = layers[number : number + 2] if up else layers[max(number - 1, 0) : number + 1]
            place = {s: (i + 0.5) / len(row) for row in near for i, s in enumerate(row)}
            towards = {s: joined.get(s, ([], []))[up] or [s] for s in layers[number]}
            mean = {s: sum(place[o] for o in others) / len(others) for s, others in towards.items()}
            layers[number].sort(key=mean.__getitem__)
    return layers


def _centres(
    layers: Sequence[Sequence[Spot]],
    layer: Mapping[str, int],
    segments: Segments,
) -> dict[Spot, float]:
    """The middle of each spot in px: near its neighbours, and apart from the spots beside it."""
    from scipy.optimize import isotonic_regression  # slow to load

    joined = _neighbours(segments)

    def distance_px(a: Spot, b: Spot) -> float:
        sizes = [WIDTH_PX + BOX_GAP_PX if layer[spot[0]] == spot[1] else LANE_PX for spot in (a, b)]
        return sum(sizes) / 2

    centre: dict[Spot, float] = {}
    for row in layers:
        at = 0.0
        for before, spot in zip([None, *row], row, strict=False):
            at += 0 if before is None else distance_px(before, spot)
            centre[spot] = at
        for spot in row:
            centre[spot] -= at / 2
    for sweep in range(ORDER_SWEEPS):
        for row in layers[:: -1 if sweep % 2 else 1]:
            targets = []
            for spot in row:
                above, below = joined.get(spot, ([], []))
                others = [*above, *below] or [spot]
                targets.append(sum(centre[o] for o in others) / len(others))
            offsets = [0.0]
            for a, b in itertools.pairwise(row):
                offsets.append(offsets[-1] + distance_px(a, b))
            free = isotonic_regression(np.subtract(targets, offsets)).x
            centre |= {s: f + o for s, f, o in zip(row, free, offsets, strict=True)}
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
