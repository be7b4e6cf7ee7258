"""One command, one file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tactograph.graph.backends import BACKENDS
from tactograph.graph.commands.completion import (
    WORDS_KEY,
    complete_graph,
    complete_overlay,
    complete_value,
)
from tactograph.graph.disk.folder_lock import alone_in
from tactograph.graph.disk.text_names import refuse_other_names
from tactograph.graph.errors import TactographError, printable

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from tactograph.graph.backends.device_backend import DeviceBackend
    from tactograph.graph.commands.progress_line import ProgressLine
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.run.pipeline import Pipeline


def say(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print text with control characters made visible: names and titles come from files."""
    click.echo(printable(text), err=err, nl=nl)


def print_table(title: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table that cuts no cell; milliseconds go right."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title)
    for each in headings:
        table.add_column(each, justify="right" if each == "ms" else "left", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console = Console(markup=False)
    if not console.is_terminal:
        console.width = 120
    console.print(table)


class GraphCommand(click.Command):
    """A command that runs a graph; after the graph's name, --help lists its params.

    With --all, it lists the parameters of its nodes as well.
    """

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_options(ctx, formatter)
        # --help is handled before the other words.
        words, _, _ = self.make_parser(ctx).parse_args(list(ctx.meta[WORDS_KEY]))
        if not isinstance(words.get("graph"), str):
            return
        from tactograph.graph.files.read_graph import read_graph, with_overlays

        graph = with_overlays(read_graph(words["graph"]), words.get("overlays") or ())
        with formatter.section(f"Params of {graph.name}"):
            params = graph.params.items()
            rows = [(f"{n}={p.kind.upper()}", printable(f"{p.state}; {p.help}")) for n, p in params]
            formatter.write_dl(rows)
        if words.get("every"):
            self._format_parameters(graph, formatter)

    def _format_parameters(self, graph: Graph, formatter: click.HelpFormatter) -> None:
        """List the parameters of a graph's nodes, as --set takes them."""
        from tactograph.graph.declare.find_node import find_node

        for name, entry in graph.nodes.items():
            node = find_node(entry.op, graph.own)
            rows = []
            for each in node.parameters.values():
                value = entry.settings.get(each.name, "needed" if each.required else each.default)
                if isinstance(value, str) and value.startswith("$"):
                    continue  # a param of the graph
                facts = "; ".join(filter(None, [each.range, node.about.arguments[each.name]]))
                rows.append((f"{name}.{each.name}={value}", printable(facts)))
            if rows:
                with formatter.section(f"--set, {name} ({node.name})"):
                    formatter.write_dl(rows)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta[WORDS_KEY] = [*args]
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            how, is_param = _how_to_give(error.option_name, ctx.meta[WORDS_KEY])
            message = f"No such option '{error.option_name}'; {how}"
            others = None if is_param else error.possibilities
            raise click.NoSuchOption(error.option_name, message, others, ctx) from None


def _how_to_give(option: str, words: Sequence[str]) -> tuple[str, bool]:
    """Say how to give a value to the graph among the words, and whether it takes the value."""
    from tactograph.graph.files.read_graph import read_graph

    name = option.lstrip("-").replace("-", "_")
    written = f"a param is written {name}={_value_of(option, words)}"
    try:
        graph = read_graph(next(word for word in words if not word.startswith("-")))
    except (StopIteration, TactographError):
        return written, False
    if name in graph.params:
        return written, True
    settings = graph.settings_called(name)
    return (f"it is written {settings}", True) if settings else (written, False)


def _value_of(option: str, words: Sequence[str]) -> str:
    """The value that was typed for an option, behind = or as the next word; else VALUE."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        name, equals, value = word.partition("=")
        if name == option:
            is_next = following and not following.startswith("-") and "=" not in following
            return value if equals else following if is_next else "VALUE"
    return "VALUE"


class GraphName(click.ParamType):  # type: ignore[type-arg]  # not generic before click 8.2
    """A graph file, or the name of a pipeline that ships; with `studies`, of a study too."""

    name = "graph"

    def __init__(self, *, studies: bool = False) -> None:
        self.studies = studies

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        return "Name a graph of 'tactograph graphs', or a graph file."

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        return complete_graph(incomplete, studies=self.studies)


FOLDER_PATH = click.Path(file_okay=False, path_type=Path)
FILE_PATH = click.Path(dir_okay=False, path_type=Path)
graph_argument = click.argument("graph", type=GraphName())


def graph_command(
    name: str, *, short_help: str, plans: bool = True
) -> Callable[[Callable[..., None]], click.Command]:
    """Decorate a function as a command that takes a graph and values for its params.

    If it `plans` the graph, it also takes `RunOptions`, as `options`.
    """
    values = click.argument(
        "values", nargs=-1, metavar="[NAME=VALUE]...", shell_complete=complete_value
    )

    def make(function: Callable[..., None]) -> click.Command:
        command = click.command(name, cls=GraphCommand, short_help=short_help)
        return command(graph_argument(values(RunOptions.add(function) if plans else function)))

    return make


with_option = click.option(
    "--with", "overlays", multiple=True, metavar="OVERLAY", shell_complete=complete_overlay,
    help="Lay an overlay, or a variant of the graph, over it; in order, before --set.",
)  # fmt: skip
set_option = click.option(
    "--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE",
    help="Change a parameter of a node.",
)  # fmt: skip
backend_option = click.option(
    "--backend", type=click.Choice(BACKENDS),
    help="Run on this back end instead of the graph's preference.",
)  # fmt: skip
device_option = click.option("--device", metavar="TEXT", help="Part of the OpenCL device's name.")


def changed(graph: Graph, overlays: Sequence[str], settings: Sequence[str]) -> Graph:
    """Apply ``--with`` and ``--set`` to a graph."""
    from tactograph.graph.files.changes import with_changes
    from tactograph.graph.files.read_graph import with_overlays
    from tactograph.graph.files.typed_values import read_settings

    return with_changes(with_overlays(graph, overlays), read_settings(settings))


_RUN_OPTIONS = (
    with_option,
    set_option,
    backend_option,
    device_option,
    click.option("--strict", is_flag=True, help="Fail if a node that has a kernel cannot use it."),
)  # fmt: skip


@dataclass(frozen=True)
class RunOptions:
    """The options of a command that plans a graph."""

    overlays: tuple[str, ...]
    settings: tuple[str, ...]
    backend: str | None
    device: str | None
    strict: bool

    @classmethod
    def add(cls, function: Callable[..., None]) -> Callable[..., None]:
        """Decorate a command with these options, which arrive as `options`."""

        @wraps(function)
        def with_options(**words: Any) -> None:
            options = {each.name: words.pop(each.name) for each in fields(cls)}
            function(options=cls(**options), **words)

        decorated: Callable[..., None] = with_options
        for option in reversed(_RUN_OPTIONS):
            decorated = option(decorated)
        return decorated

    def read(self, graph: str) -> Graph:
        """Read a graph and apply ``--with`` and ``--set``."""
        from tactograph.graph.files.read_graph import read_graph

        return changed(read_graph(graph), self.overlays, self.settings)

    def open(self, graph: Graph, arguments: Mapping[str, Any], **more: Any) -> Pipeline:
        """Plan and compile a graph by these options, and further arguments of `open_pipeline`."""
        from tactograph.graph.run.open_pipeline import open_pipeline

        return open_pipeline(
            graph, arguments, backend=self.backend, device=self.device, strict=self.strict, **more
        )

    def open_device(self, graph: Graph) -> tuple[DeviceBackend | None, str]:
        """Open the device on which the graph would run; None and the reason if none works."""
        from tactograph.graph.backends.device_backend import open_device

        return open_device([self.backend] if self.backend else graph.backends, self.device)

    def origin(self, graph: Graph, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return everything that determines the graph's outputs: see `find_origin`."""
        from tactograph.graph.cache.result_origin import find_origin

        return find_origin(graph, arguments, backend=self.backend, device=self.device)

    @staticmethod
    def progress(*, wanted: bool = True) -> ProgressLine:
        """Return a line that shows how far the command is, and prints what it has to say."""
        from tactograph.graph.commands.progress_line import ProgressLine

        return ProgressLine(wanted=wanted)

    @staticmethod
    @contextmanager
    def alone_in(folder: Path, out: str, over: Iterable[str] = ()) -> Iterator[None]:
        """Keep other processes out of a folder of `out` in the block, where folders can be locked.

        Raises InputError if another process is in it, or it cannot be made; if a name is not UTF-8;
        or if `out` is one of the places `over` which the command runs.
        """
        for place in (out, *over):
            refuse_other_names(place)
        from tactograph.graph.run.open_pipeline import refuse_to_write_over

        refuse_to_write_over(f"--out {out}", out, {f"--over {place}": place for place in over})
        with alone_in(folder):
            yield
