"""``tactograph check``: verify a graph without running it."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import GraphName, changed, say, set_option, with_option
from tactograph.graph.errors import ErrorsTogether, GraphError

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.plan.plan import Plan


@click.command("check", short_help="Verify a graph without running it.")
@click.argument("graph", metavar="GRAPH|STUDY", type=GraphName(studies=True))
@with_option
@set_option
def command(graph: str, overlays: tuple[str, ...], settings: tuple[str, ...]) -> None:
    """Resolve GRAPH, or each of STUDY, compare types, units and sizes, and list the params.

    The variants in a file are checked, too.  All errors of a pass are listed; a pass runs only if
    the previous one found none.
    """
    from tactograph.graph.files.read_graph import read_graphs

    try:
        graphs = read_graphs(graph)
        errors = ErrorsTogether()
        for read in graphs:
            with errors.gathered():
                _check(changed(read, overlays, settings), read.params.keys() - read.inherited)
        errors.raise_any()
        _check_variants(graph, graphs[0])
    except GraphError as error:
        for other in error.others:
            say(other, err=True)
        error.others = ()
        raise


def _check(read: Graph, own_params: Container[str]) -> None:
    from tactograph.graph.run.pipeline import Pipeline

    plan = Pipeline.verify(read)
    say(f"{read.name}: {read.title or 'no title'} [{read.hash}]")
    say(f"{len(plan.tasks)} nodes, {len(plan.outputs)} outputs, nothing wrong")
    for line in _written(read, plan):
        say(f"writes: {line}")
    for unused in plan.unused:
        # Outputs of a use, or of another file's group, may stay unread.
        use = read.uses.get(unused.rpartition(".")[0])
        shared = use and read.definition(use).body.file != read.file
        if not shared and not any(node in plan.tasks for node in read.alike(unused)):
            say(f"not used by any output: {unused}")
    for group, definition in read.groups.items():
        if definition.body.file == read.file and not read.uses_of(group):
            say(f"not used by any node: the group {group}")
    used_params = {param for entry in read.nodes.values() for param in entry.params.values()}
    # An inherited param is not the graph's fault.
    if unread := [n for n in read.params if n in own_params and n not in used_params]:
        say(f"params that no node reads: {', '.join(unread)}")
    width = max((len(name) for name in read.params), default=0)
    for name, param in read.params.items():
        say(f"  {name:<{width}}  {param.kind:<8} {param.state}; {param.help}")


def _check_variants(name: str, read: Graph) -> None:
    """Check the variants that a file of one's own holds; a study's are checked as graphs."""
    from tactograph.graph.files.read_graph import variants_of
    from tactograph.graph.run.pipeline import Pipeline

    if name.endswith((".yaml", ".yml")):
        for variant in variants_of(read, read.file):
            Pipeline.verify(variant)
            say(f"variant {variant.name.removeprefix(f'{read.name}_')}: nothing wrong")


def _written(graph: Graph, plan: Plan) -> list[str]:
    """The settings that name places to write to, with the places."""
    written = []
    for task in plan.tasks.values():
        for name, parameter in task.node.parameters.items():
            setting = task.entry.settings.get(name, parameter.default)
            if "Path" not in str(parameter.annotation) or setting is None:
                continue
            param = graph.params.get(str(setting)[1:]) if str(setting).startswith("$") else None
            if task.node.sink or setting == "$out":
                default = "" if param is None or param.default is None else f" ({param.default})"
                written.append(f"{task.id}.{name} to {setting}{default}")
    return written
