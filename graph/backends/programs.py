"""OpenCL programs, each built once a process.

Building one takes hundreds of times what a launch takes, even if the driver keeps binaries on
disk.  Programs belong to a context, so all queues of a device share one.
"""

from __future__ import annotations

import warnings
from functools import cache, lru_cache

import pyopencl as cl

MOST = 64
"""Of so many programs a process keeps what was built."""


@cache
def context_of(handle: cl.Device) -> cl.Context:
    """The context of all queues of a device."""
    return cl.Context([handle])


@lru_cache(MOST)
def build(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    """Build a source, or return what was built of it before.

    Raises
    ------
    cl.RuntimeError
        If it does not compile.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # compilers' remarks on their own speed
        program = cl.Program(context, source)
        program.build(options=list(options))
    return program
