"""The decorators of loops that numba compiles, and keeps from start to start.

Import this from modules of loops alone: numba takes half a second.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from typing import Any

import numba
import numpy as np
from numba import njit

from tactograph.graph import warn

compiled = njit(cache=True, nogil=True, error_model="numpy")
"""A loop: other threads go on meanwhile, and a division by zero gives what it gives in NumPy."""
inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")
"""A function of single pixels, of which a loop makes vectors if it calls nothing."""
NOTHING = np.int64(0)
"""As an argument.  A plain 0 is a constant, for which numba compiles a function once more."""


def compiled_for(signature: Any) -> Any:
    """The same for arguments of known types: compiled, or fetched, when it is imported."""
    return njit(signature, cache=True, nogil=True)


def _keep_somewhere() -> None:
    """Where no folder can be written, let this process alone keep what it compiles.

    Otherwise numba refuses to compile at all.
    """
    try:
        njit(cache=True)(_keep_somewhere)
    except RuntimeError:
        folder = tempfile.mkdtemp(prefix="tactograph-numba-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        numba.config.CACHE_DIR = folder
        warn(
            "compiled loops cannot be kept, neither beside the package nor in your cache folder: "
            "every start compiles them again, half a minute; set NUMBA_CACHE_DIR to a folder "
            "that can be written"
        )


_keep_somewhere()
