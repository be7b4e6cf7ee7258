"""PoCL's programs on disk, which it trusts: a damaged one ends the process, whatever it does.

That can neither be caught nor told by who is ended.  So each process that uses PoCL leaves a
note, into which Python writes how it was ended.  The next one reads it, and has PoCL keep its
programs elsewhere.
"""

from __future__ import annotations

import atexit
import faulthandler
import os
import shutil
import sys
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

from tactograph.graph.disk.disk_cache import cache_folder

CACHE_VARIABLE = "POCL_CACHE_DIR"
"""The environment variable that PoCL reads as it is loaded."""


@cache
def heed_crashes() -> None:
    """Have PoCL, before it is loaded, keep its programs where none is damaged, and say so."""
    folder = _place()
    if folder is None:
        return
    told, ours = os.environ.get(CACHE_VARIABLE), folder / "pocl"
    if how := _crashes(folder):
        damaged = Path(told) if told else ours if ours.is_dir() else _usual_place()
        what = (
            f"a run before died of '{how}' while it used PoCL: what {damaged} holds may be damaged"
        )
        if told:
            warnings.warn(f"{what}; empty that folder", stacklevel=2)
        else:
            shutil.rmtree(ours, ignore_errors=True)
            with suppress(OSError):
                ours.mkdir(parents=True, mode=0o700)
            warnings.warn(f"{what}; PoCL keeps its programs in {ours} from now on", stacklevel=2)
    if not told and ours.is_dir():
        os.environ[CACHE_VARIABLE] = str(ours)


@cache
def note_crash() -> None:
    """Have a note written if this process is ended from now on, unless somebody else listens."""
    folder = _place()
    if folder is None or faulthandler.is_enabled():
        return
    file = _notes(folder) / str(os.getpid())
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        faulthandler.enable(file.open("w"), all_threads=False)
        atexit.register(file.unlink, missing_ok=True)
        atexit.register(faulthandler.disable)


def _place() -> Path | None:
    # There one cannot ask whether a process is running without ending it.
    return None if sys.platform == "win32" else cache_folder()


def _crashes(folder: Path) -> str:
    """How a process was ended that left a note, or "" where none was; notes are read once."""
    how = ""
    with suppress(OSError):
        for file in _notes(folder).iterdir():
            if _is_running(int(file.name)):
                continue
            lines = file.read_text(errors="replace").splitlines()
            how = lines[0].rpartition(": ")[2] if lines else how
            file.unlink()
    return how


def _notes(folder: Path) -> Path:
    return folder / "crashes"


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's
        return True
    return True


def _usual_place() -> Path:
    caches = os.environ.get("XDG_CACHE_HOME")
    return (Path(caches) if caches else Path.home() / ".cache") / "pocl" / "kcache"
