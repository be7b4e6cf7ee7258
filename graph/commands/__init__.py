"""One command, one file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])


def run_options(function: F) -> F:
    """The options of every command that plans a graph."""
    for option in reversed(
        (
            click.option(
                "--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE",
                help="Change a parameter of a node.",
            ),
            click.option(
                "--backend", type=click.Choice(["numpy", "opencl"]),
                help="Run on this back end instead of the graph's preference.",
            ),
            click.option("--device", metavar="TEXT", help="Part of the OpenCL device's name."),
            click.option("--strict", is_flag=True, help="Fail rather than fall back."),
        )
    ):  # fmt: skip
        function = option(function)
    return function
