"""Draw a sketch as text: DOT for graphviz, Mermaid for web pages."""

from collections.abc import Mapping, Sequence

from tactograph.graph.backends import BACKENDS
from tactograph.graph.show.sketch import Box, Sketch

_DOT_SHAPES = {"upload": "cds", "download": "cds", "run": "box", "fill": "box", "use": "box3d"}
_MERMAID_BRACKETS = {"upload": ("([", "])"), "download": ("([", "])"), "use": ("[[", "]]")}
BACKEND_COLOURS: dict[str, str] = {**dict.fromkeys(BACKENDS, "#fbe3c5"), "numpy": "#dbe9f6"}


def to_dot(sketch: Sketch) -> str:
    """The sketch as a DOT digraph, boxes coloured by back end."""
    lines = [
        f'digraph "{_quoted(sketch.title)}" {{',
        '  rankdir=TB; node [fontname="sans-serif", fontsize=10, style="filled,rounded"];',
        '  edge [fontname="sans-serif", fontsize=8];',
    ]
    drawn: dict[str, list[str]] = {}
    for box in sketch.boxes:
        drawn.setdefault(box.use, []).append(
            f'"{box.name}" [label="{_label(box, chr(92) + "n")}", '
            f'shape={_DOT_SHAPES[box.kind]}, fillcolor="{BACKEND_COLOURS[box.backend]}"];'
        )
    cluster = 'subgraph "cluster_{use}" {{ label="{use}"; color="#999999"; fontsize=10;'
    lines += _in_clusters(drawn, cluster, "}")
    lines += [f'  "{a}" -> "{b}" [label="{port}"];' for a, b, port in sketch.edges]
    lines += [
        f'  "{a}" -> "{b}" [label="previous {port}", style=dashed, constraint=false];'
        for a, b, port in sketch.recalls
    ]
    return "\n".join([*lines, "}", ""])


def to_mermaid(sketch: Sketch) -> str:
    """The sketch as a Mermaid flow chart."""
    ids = {box.name: f"n{index}" for index, box in enumerate(sketch.boxes)}
    lines = ["flowchart TB"]
    drawn: dict[str, list[str]] = {}
    for box in sketch.boxes:
        left, right = _MERMAID_BRACKETS.get(box.kind, ("[", "]"))
        drawn.setdefault(box.use, []).append(
            f'{ids[box.name]}{left}"{_label(box, "<br/>")}"{right}:::{box.backend}'
        )
    lines += _in_clusters(drawn, 'subgraph use_{id}["{use}"]', "end")
    lines += [f"  {ids[a]} -->|{port}| {ids[b]}" for a, b, port in sketch.edges]
    lines += [f"  {ids[a]} -.->|previous {port}| {ids[b]}" for a, b, port in sketch.recalls]
    lines += [f"  classDef {name} fill:{colour}" for name, colour in BACKEND_COLOURS.items()]
    return "\n".join([*lines, ""])


def _in_clusters(
    drawn: Mapping[str, Sequence[str]], begin: str, end: str, around: str = "", deep: str = "  "
) -> list[str]:
    """The lines of each use between `begin` and `end`, a use inside another in its lines."""
    lines = [f"{deep}{line}" for line in drawn.get(around, ())]
    prefix = f"{around}." if around else ""
    inside = [use[len(prefix) :].partition(".")[0] for use in drawn if use.startswith(prefix)]
    for name in dict.fromkeys(filter(None, inside)):
        use = prefix + name
        body = _in_clusters(drawn, begin, end, use, f"{deep}  ")
        first = begin.format(use=use, id=use.replace(".", "_"))
        lines += [f"{deep}{first}", *body, f"{deep}{end}"]
    return lines


def _quoted(text: str) -> str:
    """Text from outside the graph file's strict names, made safe between DOT's quotes."""
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _label(box: Box, newline: str) -> str:
    return f"{box.name}{newline}{box.label}"
