"""The command line.  It knows graphs and nothing else."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Any, TextIO

import click

from tactograph.graph.errors import TactographError, printable
from tactograph.graph.run.collect_seldom import collect_seldom

COMMANDS = (
    "demo",
    "run",
    "tune",
    "compare",
    "batch",
    "check",
    "resolve",
    "explain",
    "draw",
    "graphs",
    "nodes",
    "new-node",
    "devices",
    "cameras",
    "bench",
    "schema",
)


STOPPED = (
    "tactograph: stopped; no file is half written. The same command starts again; "
    "'compare' and 'batch' go on where they were"
)


class _Lazy(click.Group):
    """Loads a command's module only when it is needed, so that --help stays quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"tactograph.graph.commands.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="tactograph", prog_name="tactograph")
def _group() -> None:
    """Height maps in mm from optical touch sensors, as an editable processing graph."""


def run_command(words: list[str]) -> None:
    """Run one command within this process, as if it had been typed."""
    _group.main(words, standalone_mode=False)


def main() -> None:
    """Run the command line: exit 0 when done, 2 if the input is wrong, 1 for anything else."""
    collect_seldom()
    warnings.showwarning = _show_warning
    try:
        code: Any = _group.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo(STOPPED, err=True)
        code = 130
    except TactographError as error:
        click.echo(f"tactograph: {_one_line(error)}", err=True)
        code = error.exit_code
    except BrokenPipeError:
        # The reader of a pipe such as `| head` has gone; nothing is left to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except MemoryError:
        click.echo("tactograph: out of memory", err=True)
        code = 1
    except Exception as error:
        if os.environ.get("TACTOGRAPH_TRACEBACK"):
            raise
        click.echo(
            f"tactograph: internal error: {type(error).__name__}: {_one_line(error)} "
            "(TACTOGRAPH_TRACEBACK=1 shows where)",
            err=True,
        )
        code = 1
    sys.exit(code if isinstance(code, int) else 0)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    click.echo(f"warning: {printable(' '.join(str(message).split()))}", err=True)


def _one_line(error: Exception) -> str:
    return printable(" ".join(str(error).split()))


if __name__ == "__main__":
    main()
