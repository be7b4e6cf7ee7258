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
    from click.shell_completion import CompletionItem

    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.run.cache import Cache
    from tactograph.graph.run.pipeline import Pipeline


def say(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print, with what a terminal would obey made visible: names and titles come from files."""
    click.echo(printable(text), err=err, nl=nl)


_WORDS = f"{__name__}.words"
"""Where a context keeps the words behind a command."""


class GraphCommand(click.Command):
    """A command that runs a graph; behind the graph's name, --help lists its params."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_options(ctx, formatter)
        # --help is dealt with before the other words are.
        words, _, _ = self.make_parser(ctx).parse_args(list(ctx.meta[_WORDS]))
        if not isinstance(words.get("graph"), str):
            return
        from tactograph.graph.files.read_graph import read_graph

        graph = read_graph(words["graph"])
        with formatter.section(f"Params of {graph.name}"):
            rows = graph.params.items()
            formatter.write_dl(
                [
                    (f"{name}={p.kind.upper()}", printable(f"{p.state}; {p.help}"))
                    for name, p in rows
                ]
            )

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta[_WORDS] = [*args]
        return super().parse_args(ctx, args)


class GraphName(click.ParamType):  # type: ignore[type-arg]  # not generic before click 8.2
    """A graph file, or the name of a pipeline that ships."""

    name = "graph"

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        return "Name one that ships, of 'tactograph graphs', or a file of your own."

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from tactograph.graph.commands.completion import complete_graph

        return complete_graph(incomplete)


def _complete_value(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    from tactograph.graph.commands.completion import complete_value

    return complete_value(ctx.params.get("graph"), ctx.params.get("values") or (), incomplete)


graph_argument = click.argument("graph", type=GraphName())
values_argument = click.argument(
    "values", nargs=-1, metavar="[NAME=VALUE]...", shell_complete=_complete_value
)


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
    click.option("--strict", is_flag=True, help="Fail if a node that has a kernel cannot use it."),
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
