"""Programs built ahead by processes of their own, while this one builds those that it needs first.

PoCL compiles one program at a time in a process.  A helper goes through a plan's programs, passes
over those that another process is at, and keeps them on disk (`programs.py`).  It writes to no
terminal, and ends with its parent.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence

import pyopencl as cl

from tactograph.graph.backends.programs import (
    POCL_PLATFORM,
    Recipe,
    ahead,
    build_if_free,
    context_of,
    is_ready,
)
from tactograph.graph.cores import cores

MIN_AHEAD_PROGRAMS = 4
"""The fewest programs not on disk that justify a process: it takes as long to start as two."""
MAX_HELPERS = 3
helpers: list[subprocess.Popen[bytes]] = []


def build_ahead(context: cl.Context, needed: Sequence[Recipe], perhaps: Sequence[Recipe]) -> None:
    """Begin to build programs that are not on disk, in this order, on the cores beside ours.

    Those that are needed `perhaps` come last, and are left to helpers.
    """
    (handle,) = context.devices
    missing = [r for r in (*needed, *perhaps) if not is_ready(handle, *r)]
    ahead.extend(recipe for recipe in needed if recipe in missing)
    number = min(cores() - 1, MAX_HELPERS, len(missing) // MIN_AHEAD_PROGRAMS)
    is_busy = any(helper.poll() is None for helper in helpers)
    if number < 1 or is_busy or not sys.executable:
        return
    for _ in range(number):
        # Not a pipe: it would fill, and make this process wait until the helper has started.
        with tempfile.TemporaryFile() as told:
            pickle.dump((os.getpid(), handle.name, missing), told)
            told.seek(0)
            helper = subprocess.Popen(
                [sys.executable, "-m", __name__],
                stdin=told,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONSAFEPATH": "1"},
                start_new_session=True,  # Ctrl-C is for this process
            )
            helpers.append(helper)


def main() -> None:
    """Build what the parent wrote into the standard input."""
    parent, name, recipes = pickle.load(sys.stdin.buffer)
    platforms = (p for p in cl.get_platforms() if p.name == POCL_PLATFORM)
    context = next(context_of(d) for p in platforms for d in p.get_devices() if d.name == name)
    for source, options in recipes:
        if os.getppid() != parent:
            return
        build_if_free(context, source, options)


if __name__ == "__main__":
    main()
