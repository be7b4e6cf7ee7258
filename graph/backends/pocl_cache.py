"""Protection from damaged programs in PoCL's cache: PoCL trusts them, and a damaged one kills the
process.

The process can neither catch nor report that.  So each process that uses PoCL leaves a note, into
which Python writes how the process died.  The next process reads the note and moves PoCL's programs
to another folder.
"""

import atexit
import faulthandler
import os
import shutil
import sys
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

import platformdirs

from tactograph.graph.disk.disk_cache import cache_folder, can_be_written

CACHE_VARIABLE = "POCL_CACHE_DIR"
"""The environment variable that PoCL reads when it is loaded."""
SPECIALISE_VARIABLE = "POCL_WORK_GROUP_SPECIALIZATION"
"""Whether PoCL compiles a kernel again for each size of its work-groups."""


def compile_once() -> None:
    """Before PoCL is loaded, have it launch kernels as compiled for any size of work-group.

    A binary contains that version, and it is as fast, since lanes are filled by hand.
    """
    os.environ.setdefault(SPECIALISE_VARIABLE, "0")


@cache
def unwritable_folder(variable: str = "XDG_CACHE_HOME") -> Path | None:
    """The folder for caches of this variable, if unwritable: PoCL then has no device."""
    chosen = os.environ.get(variable) if variable == CACHE_VARIABLE else None
    folder = Path(chosen or platformdirs.user_cache_dir())
    return None if can_be_written(folder) else folder


@cache
def heed_crashes() -> None:
    """Before PoCL is loaded, point it to a folder without damaged programs, with a warning."""
    folder = _place()
    if folder is None:
        return
    chosen, ours = os.environ.get(CACHE_VARIABLE), folder / "pocl"
    if how := _crashes(folder):
        damaged = Path(chosen) if chosen else ours if ours.is_dir() else _usual_place()
        damage = (
            f"an earlier run died of '{how}' while it used PoCL: files in {damaged} may be damaged"
        )
        if chosen:
            warnings.warn(f"{damage}; empty that folder", stacklevel=2)
        else:
            shutil.rmtree(ours, ignore_errors=True)
            with suppress(OSError):
                ours.mkdir(parents=True, mode=0o700)
            warnings.warn(f"{damage}; PoCL keeps its programs in {ours} from now on", stacklevel=2)
    if not chosen and ours.is_dir():
        os.environ[CACHE_VARIABLE] = str(ours)


@cache
def note_crash() -> None:
    """Leave a note if this process dies from now on, unless a fault handler is set already."""
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
    # On Windows, the test whether a process runs would end it.
    return None if sys.platform == "win32" else cache_folder()


def _crashes(folder: Path) -> str:
    """The cause of death in the notes, or ""; each note is read once."""
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
