"""The command line.  It knows graphs and nothing else."""

import importlib
import os
import sys
import warnings
from contextlib import suppress
from typing import Any, cast

import click
from click.exceptions import NoArgsIsHelpError

from tactograph.graph.errors import (
    NodeError,
    TactographError,
    WriteError,
    did_you_mean,
    is_of_printing,
    message_of,
    of_system,
    printable,
)
from tactograph.graph.run.collect_seldom import collect_seldom

COMMANDS = (
    "demo",
    "run",
    "compare",
    "check",
    "resolve",
    "explain",
    "draw",
    "graphs",
    "nodes",
    "new-node",
    "new-ring",
    "devices",
    "bench",
    "warm",
    "schema",
)
STOPPED_MESSAGE = (
    "tactograph: stopped; no file is half written. Run the same command to start again; "
    "'compare' and 'batch' continue where they stopped"
)

SIGPIPE_EXIT_CODE = 141
"""The exit code of a shell for a program that SIGPIPE ended."""


class _Lazy(click.Group):
    """Loads a command's module only when it is needed, so that --help stays quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS, *_ring_verbs()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        file = cmd_name.replace("-", "_")
        if cmd_name in COMMANDS:
            module = importlib.import_module(f"tactograph.graph.commands.{file}")
            return cast(click.Command, module.command)
        return _ring_command(cmd_name)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            name = error.option_name
            message = f"No such option '{name}'; write a command's option behind the command"
            raise click.NoSuchOption(name, message, error.possibilities, ctx) from None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        word = args[0]
        is_known = word in (*COMMANDS, *_ring_verbs()) or word.startswith("-")
        if not is_known and not ctx.resilient_parsing:
            ctx.fail(f"No such command '{printable(word)}'{_meant(word)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError as error:
            # Click would end with exit code 1 and without a word.
            raise _BrokenPipe from error


def _ring_verbs() -> list[str]:
    """The commands of rings; commands of the core have precedence."""
    from tactograph.graph.rings import brought

    return sorted({name.replace("_", "-") for name in brought("verbs")} - {*COMMANDS})


def _ring_command(name: str) -> click.Command | None:
    """The command that a ring brings under this name."""
    from tactograph.graph.rings import bring

    module = bring("verbs", name.replace("-", "_"))
    if module is None:
        return None
    command = getattr(module, "command", None)
    if not isinstance(command, click.Command):
        raise NodeError(f"{module.__name__} has no click command called 'command'")
    return command


def _meant(word: str) -> str:
    """A hint for a word that is no command."""
    from tactograph.graph.files.read_graph import shipped_names

    if word in shipped_names() or word.endswith((".yaml", ".yml")):
        return f"; to run a graph write 'tactograph run {printable(word)}'"
    return did_you_mean(word, [*COMMANDS, *_ring_verbs()])


class _BrokenPipe(Exception):  # noqa: N818  (not always an error)
    """Caused by a pipe without a reader: standard output, or another."""


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="tactograph", prog_name="tactograph")
def command_line() -> None:
    """Height maps in mm from optical touch sensors, as an editable processing graph."""


def run_command(words: list[str]) -> None:
    """Run one command in this process, as if it had been typed."""
    command_line.main(words, standalone_mode=False)


def main() -> None:
    """Run the command line: exit 0 when done, 2 if the input is wrong, 1 for anything else.

    If the reader of its output has gone, it exits with 141 like other programs.
    """
    collect_seldom()
    # Pictures go into files, so no other back end of Matplotlib is needed.
    os.environ["MPLBACKEND"] = "agg"
    warnings.showwarning = _show_warning
    if "_TACTOGRAPH_COMPLETE" in os.environ:
        importlib.import_module("tactograph.graph.commands")
    try:
        code: Any = command_line.main(standalone_mode=False)
    except SystemExit:
        raise
    except BaseException as error:
        code = _report(error)
    sys.exit(code if isinstance(code, int) else 0)


def _report(error: BaseException) -> int:
    """Say in one line why the command ended, and return its exit code."""
    if isinstance(error, click.UsageError) and not isinstance(error, NoArgsIsHelpError):
        words = error.ctx.command_path if error.ctx else "tactograph"
        message = " ".join(error.format_message().rstrip(".").split())
        click.echo(f"tactograph: {printable(message)} (see '{words} --help')", err=True)
        return error.exit_code
    if isinstance(error, click.ClickException):
        error.show()
        return error.exit_code
    if isinstance(error, click.Abort | KeyboardInterrupt):
        click.echo(STOPPED_MESSAGE, err=True)
        return 130
    if isinstance(error, MemoryError):
        click.echo("tactograph: out of memory", err=True)
        return 1
    if isinstance(error, TactographError):
        others = len(error.others)
        more = f" ({others} more: 'tactograph check' lists them)" if others else ""
        click.echo(f"tactograph: {_one_line(error)}{more}", err=True)
        return error.exit_code
    return _report_unexpected(error)


def _report_unexpected(error: BaseException) -> int:
    error = error.__cause__ if isinstance(error, _BrokenPipe) and error.__cause__ else error
    if isinstance(error, OSError) and is_of_printing(error):
        return _end_unheard(error)
    if os.environ.get("TACTOGRAPH_TRACEBACK"):
        raise error
    if refusal := of_system(error):
        return _report(refusal)
    message = f"{type(error).__name__}: {_one_line(error)} (TACTOGRAPH_TRACEBACK=1 shows where)"
    click.echo(f"tactograph: internal error: {message}", err=True)
    return 1


def _end_unheard(error: OSError) -> int:
    """Stop printing, report why if standard error still works, and return the exit code."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    if isinstance(error, BrokenPipeError):  # the reader, such as `| head`, has gone
        os.dup2(nowhere, sys.stderr.fileno())
        return SIGPIPE_EXIT_CODE
    with suppress(OSError):
        reason = error.strerror or error
        click.echo(f"tactograph: cannot write to standard output: {reason}", err=True)
    return WriteError.exit_code


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    click.echo(f"warning: {printable(' '.join(str(message).split()))}", err=True)


def _one_line(error: BaseException) -> str:
    return printable(" ".join(message_of(error).split()))


if __name__ == "__main__":
    main()
