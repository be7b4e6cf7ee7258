"""Draw a plan: DOT for graphviz, Mermaid for web pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tactograph.graph.backends import BACKENDS
from tactograph.graph.plan.plan import Plan, Step

_SHAPES = {"upload": "cds", "download": "cds", "run": "box", "fill": "box"}
COLOURS: dict[str, str] = {**dict.fromkeys(BACKENDS, "#fbe3c5"), "numpy": "#dbe9f6"}


def to_dot(plan: Plan) -> str:
    """The plan as a DOT digraph: nodes coloured by back end, transfers as arrows."""
    lines = [
        f'digraph "{_quoted(plan.graph.name)}" {{',
        '  rankdir=LR; node [fontname="sans-serif", fontsize=10, style="filled,rounded"];',
        '  edge [fontname="sans-serif", fontsize=8];',
    ]
    drawn: dict[str, list[str]] = {}
    for step in plan.steps:
        drawn.setdefault(use_of(step), []).append(
            f'"{step.name}" [label="{_label(plan, step, chr(92) + "n")}", '
            f'shape={_SHAPES[step.kind]}, fillcolor="{COLOURS[step.backend]}"];'
        )
    cluster = 'subgraph "cluster_{use}" {{ label="{use}"; color="#999999"; fontsize=10;'
    lines += _in_clusters(drawn, cluster, "}")
    lines += [f'  "{a}" -> "{b}" [label="{port}"];' for a, b, port in edges(plan)]
    lines += [
        f'  "{a}" -> "{b}" [label="previous {port}", style=dashed, constraint=false];'
        for a, b, port in recalls(plan)
    ]
    return "\n".join([*lines, "}", ""])


def to_mermaid(plan: Plan) -> str:
    """The plan as a Mermaid flow chart."""
    ids = {step.name: f"n{index}" for index, step in enumerate(plan.steps)}
    lines = ["flowchart LR"]
    drawn: dict[str, list[str]] = {}
    for step in plan.steps:
        left, right = ("([", "])") if step.kind in ("upload", "download") else ("[", "]")
        drawn.setdefault(use_of(step), []).append(
            f'{ids[step.name]}{left}"{_label(plan, step, "<br/>")}"{right}:::{step.backend}'
        )
    lines += _in_clusters(drawn, 'subgraph use_{id}["{use}"]', "end")
    lines += [f"  {ids[a]} -->|{port}| {ids[b]}" for a, b, port in edges(plan)]
    lines += [f"  {ids[a]} -.->|previous {port}| {ids[b]}" for a, b, port in recalls(plan)]
    lines += [f"  classDef {name} fill:{colour}" for name, colour in COLOURS.items()]
    return "\n".join([*lines, ""])


def use_of(step: Step) -> str:
    """The use of a group that a step is in: what stands before the last dot of its node."""
    node = step.name if step.kind in ("run", "fill") else step.reads[0].node
    return node.rpartition(".")[0]


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


def edges(plan: Plan, *, transfers: bool = True) -> list[tuple[str, str, str]]:
    """Every edge between steps as (from, to, port), with the transfers in between or without."""
    if not transfers:
        names = plan.tasks.items()
        return [
            (v.node, n, v.port) for n, task in names for v in dict.fromkeys(task.reads.values())
        ]
    moves = {s.reads[0]: s for s in plan.steps if s.kind in ("upload", "download")}
    on_device = {step.name: step.on_device for step in plan.steps}
    found: dict[tuple[str, str, str], None] = {}
    for step in plan.steps:
        for value in step.reads:
            maker = value.node
            moved = moves.get(value)
            if moved is not None and step is not moved and on_device[maker] != step.on_device:
                maker = moved.name
            found[maker, step.name, value.port] = None
    return list(found)


def recalls(plan: Plan) -> list[tuple[str, str, str]]:
    """Every edge from an item to the next one as (from, to, port)."""
    return [
        (value.node, task.id, value.port)
        for task in plan.tasks.values()
        for value in task.recalls.values()
    ]


def _quoted(text: str) -> str:
    """Text from outside the graph file's strict names, made safe between DOT's quotes."""
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _label(plan: Plan, step: Step, newline: str) -> str:
    task = plan.tasks.get(step.name)
    return f"{step.name}{newline}{task.node.name}" if task else step.kind
