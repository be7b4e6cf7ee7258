"""Draw a sketch as a Mermaid flow chart, a text that web pages and editors draw."""

from collections.abc import Mapping, Sequence

from tactograph.graph.backends import BACKENDS
from tactograph.graph.show.sketch import Sketch

_BOX_BRACKETS = {"upload": ("([", "])"), "download": ("([", "])"), "use": ("[[", "]]")}
BACKEND_COLOURS: dict[str, str] = {**dict.fromkeys(BACKENDS, "#fbe3c5"), "numpy": "#dbe9f6"}


def to_mermaid(sketch: Sketch) -> str:
    """The sketch as text, boxes coloured by back end."""
    ids = {box.name: f"n{index}" for index, box in enumerate(sketch.boxes)}
    drawn: dict[str, list[str]] = {}
    for box in sketch.boxes:
        left, right = _BOX_BRACKETS.get(box.kind, ("[", "]"))
        text = f'{left}"{box.name}<br/>{box.label}"{right}'
        drawn.setdefault(box.use, []).append(f"{ids[box.name]}{text}:::{box.backend}")
    lines = ["flowchart TB", *_in_uses(drawn)]
    lines += [f"  {ids[a]} -->|{port}| {ids[b]}" for a, b, port in sketch.edges]
    lines += [f"  {ids[a]} -.->|previous {port}| {ids[b]}" for a, b, port in sketch.recalls]
    lines += [f"  classDef {name} fill:{colour}" for name, colour in BACKEND_COLOURS.items()]
    return "\n".join([*lines, ""])


def _in_uses(drawn: Mapping[str, Sequence[str]], around: str = "", indent: str = "  ") -> list[str]:
    """The lines of each use in a subgraph, a use inside another in its lines."""
    lines = [f"{indent}{line}" for line in drawn.get(around, ())]
    prefix = f"{around}." if around else ""
    inside = [use[len(prefix) :].partition(".")[0] for use in drawn if use.startswith(prefix)]
    for use in dict.fromkeys(prefix + name for name in inside if name):
        head = f'{indent}subgraph use_{use.replace(".", "_")}["{use}"]'
        lines += [head, *_in_uses(drawn, use, f"{indent}  "), f"{indent}end"]
    return lines
