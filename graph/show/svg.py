"""Boxes and edges of a sketch as SVG."""

from collections.abc import Iterable
from html import escape

from tactograph.graph.show.draw_text import BACKEND_COLOURS
from tactograph.graph.show.sketch import Box

WIDTH_PX, HEIGHT_PX = 150, 34
"""Size of a box."""
MARGIN_PX = 20
"""Space around the drawing."""
ARROW_TIP = ' marker-end="url(#tip)"'
DASHED_LINE = ' stroke-dasharray="4 3"'


def drawing(title: str, width: float, height: float, lines: Iterable[str]) -> str:
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


def drawn_box(box: Box, left: float, top: float, title: str, words: str) -> list[str]:
    """A box, coloured by back end; ``data-node`` names it.  A folded use has a broad rim."""
    rim = ' stroke-width="2.5"' if box.kind == "use" else ""
    x, middle = round(left, 1), f'x="{left + WIDTH_PX / 2:.1f}" text-anchor="middle"'
    return [
        f'<g data-node="{escape(box.name)}">',
        f'<rect x="{x}" y="{top}" width="{WIDTH_PX}" height="{HEIGHT_PX}" rx="5" '
        f'fill="{BACKEND_COLOURS[box.backend]}" stroke="#555"{rim}/>',
        f'<text {middle} y="{top + 14}" font-weight="bold">{escape(title)}</text>',
        f'<text {middle} y="{top + 27}">{escape(words)}</text>',
        "</g>",
    ]


def drawn_edge(way: str, ports: str, more: str = "") -> str:
    """A path that shows the names of its ports."""
    path = f'<path d="{way}" fill="none" stroke="#777"{more}>'
    return f"{path}<title>{escape(ports)}</title></path>"
