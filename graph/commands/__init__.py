"""One command, one file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from tactograph.graph.backends import BACKENDS
from tactograph.graph.errors import printable

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.run.cache import Cache
    from tactograph.graph.run.pipeline import Pipeline


def say(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print, with what a terminal would obey made visible: names and titles come from files."""
    click.echo(printable(text), err=err, nl=nl)


class _Graph(click.ParamType):  # type: ignore[type-arg]  # not generic before click 8.2
    """A graph file, or the name of a pipeline that ships."""

    name = "graph"

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        return "Name one that ships, of 'tactograph graphs', or a file of your own."


graph_argument = click.argument("graph", type=_Graph())


@dataclass(frozen=True)
class RunOptions:
    """What the options of a command that plans a graph were set to."""

    settings: tuple[str, ...]
    backend: str | None
    device: str | None
    strict: bool

    def read(self, graph: str) -> Graph:
        """Read a graph with ``--set`` worked in."""
        from tactograph.graph.files.changes import with_changes
        from tactograph.graph.files.read_graph import read_graph
        from tactograph.graph.run.typed_values import read_settings

        return with_changes(read_graph(graph), read_settings(self.settings))

    def open(
        self,
        graph: Graph,
        given: Mapping[str, Any],
        *,
        sinks: bool = True,
        cache: Cache | None = None,
    ) -> Pipeline:
        """Plan and compile a graph where the options say."""
        from tactograph.graph.run.open_pipeline import open_pipeline

        return open_pipeline(
            graph,
            given,
            backend=self.backend,
            device=self.device,
            strict=self.strict,
            sinks=sinks,
            cache=cache,
        )


_RUN_OPTIONS = (
    click.option(
        "--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE",
        help="Change a parameter of a node.",
    ),
    click.option(
        "--backend", type=click.Choice(BACKENDS),
        help="Run on this back end instead of the graph's preference.",
    ),
    click.option("--device", metavar="TEXT", help="Part of the OpenCL device's name."),
    click.option("--strict", is_flag=True, help="Fail rather than fall back."),
)  # fmt: skip


def run_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add the options of every command that plans a graph; they arrive as `options`."""

    @wraps(function)
    def with_options(
        *, settings: tuple[str, ...], backend: str | None, device: str | None, strict: bool,
        **rest: Any,
    ) -> None:  # fmt: skip
        function(options=RunOptions(settings, backend, device, strict), **rest)

    found: Callable[..., None] = with_options
    for option in reversed(_RUN_OPTIONS):
        found = option(found)
    return found
