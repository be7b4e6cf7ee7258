"""Build programs ahead in helper processes, while this process builds those that it needs first.

A driver compiles one program at a time in a process.  A helper starts its compiler while this
process still plans.  Then it goes through a plan's programs, skips those that another process is
building, and keeps them on disk (`programs.py`).  It writes to no terminal, and ends with its
parent.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from threading import Thread

import pyopencl as cl

from tactograph.graph.backends.programs import (
    CACHED_PLATFORMS,
    Recipe,
    ahead,
    build_if_free,
    context_of,
    is_ready,
    start_compiler,
)
from tactograph.graph.cores import cores
from tactograph.graph.errors import NotBuiltError

MIN_AHEAD_PROGRAMS = 4
"""Smallest number of missing programs for a helper, which starts in the time of two builds."""
MAX_HELPERS = 3
helpers: list[subprocess.Popen[bytes]] = []
_idle: list[subprocess.Popen[bytes]] = []
"""Idle helpers, which wait for programs to build."""


def begin_helpers(device: cl.Device) -> None:
    """Start helpers on the other cores, which wait for programs to build."""
    if any(helper.poll() is None for helper in helpers) or not sys.executable:
        return
    for _ in range(min(cores() - 1, MAX_HELPERS)):
        helper = subprocess.Popen(
            [sys.executable, "-m", __name__, str(os.getpid()), device.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONSAFEPATH": "1"},
            start_new_session=True,  # Ctrl-C is for this process
        )
        helpers.append(helper)
        _idle.append(helper)


def build_ahead(
    context: cl.Context, needed: Sequence[Recipe], perhaps: Sequence[Recipe], *, waits: bool = True
) -> None:
    """Begin to build programs that are not on disk, in this order, on the other cores.

    Programs that are needed `perhaps` come last, and are left to helpers.  Raises NotBuiltError
    instead if a needed program is not on disk and the caller does not wait for it.
    """
    (handle,) = context.devices
    missing = [r for r in (*needed, *perhaps) if not is_ready(handle, *r)]
    awaited = [recipe for recipe in needed if recipe in missing]
    if awaited and not waits:
        count = f"{len(awaited)} of {len(needed)} programs"
        share = len(awaited) / len(needed)
        raise NotBuiltError(f"its kernels are not built yet ({count})", share)
    ahead.extend(awaited)
    if len(missing) >= MIN_AHEAD_PROGRAMS:
        begin_helpers(handle)
    while _idle:
        # In a thread: a helper that is still starting does not read yet.
        Thread(target=_tell, args=(_idle.pop(), missing), daemon=True).start()


def _tell(helper: subprocess.Popen[bytes], recipes: Sequence[Recipe]) -> None:
    assert helper.stdin is not None
    with suppress(OSError), helper.stdin as pipe:  # it may have ended
        pickle.dump(recipes, pipe)


def main() -> None:
    """Build the programs that the parent writes to standard input."""
    parent, name = sys.argv[1:]
    platforms = (p for p in cl.get_platforms() if p.name in CACHED_PLATFORMS)
    context = next(context_of(d) for p in platforms for d in p.get_devices() if d.name == name)
    start_compiler(context)
    with suppress(EOFError):  # there was nothing to build
        for source, options in pickle.load(sys.stdin.buffer):
            if os.getppid() != int(parent):
                return
            build_if_free(context, source, options)


if __name__ == "__main__":
    main()
