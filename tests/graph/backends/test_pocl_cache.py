"""A damaged program in PoCL's cache ends one run, not all that follow."""

import signal
import sys
from pathlib import Path

import pytest

from tests.fixtures import python

DIES = """
import os
from tactograph.graph.backends.pocl_cache import note_crash
note_crash()
os.kill(os.getpid(), {number:d})
"""
BEGINS = """
import os
from tactograph.graph.backends.pocl_cache import heed_crashes
heed_crashes()
print(os.environ.get("POCL_CACHE_DIR", "the usual place"))
"""


class Runs:
    """Processes that share a cache."""

    def __init__(self, folder: Path) -> None:
        self.cache, self.usual = folder / "cache", folder / "xdg" / "pocl" / "kcache"
        self._places = {"TACTOGRAPH_CACHE": self.cache, "XDG_CACHE_HOME": folder / "xdg"}

    def die(self, number: int) -> None:
        python("-c", DIES.format(number=number), code=-number, **self._places)

    def begin(self, **more: str) -> tuple[str, str]:
        """PoCL's folder of programs, and the warnings."""
        done = python("-c", BEGINS, **self._places, **more)
        return done.stdout.strip(), done.stderr


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Runs:
    monkeypatch.delenv("POCL_CACHE_DIR", raising=False)
    return Runs(tmp_path)


@pytest.mark.parametrize(
    ("number", "how"), [(signal.SIGABRT, "Aborted"), (signal.SIGBUS, "Bus error")]
)
def test_after_a_crash_programs_go_to_another_folder_and_a_warning_names_the_damaged_one(
    runs: Runs, number: int, how: str
) -> None:
    runs.die(number)
    place, warnings = runs.begin()
    assert place == str(runs.cache / "pocl")
    assert f"an earlier run died of '{how}' while it used PoCL: files in {runs.usual}" in warnings
    assert runs.begin() == (place, ""), "one warning, and never again"


def test_a_folder_that_tactograph_chose_is_emptied(runs: Runs) -> None:
    runs.die(signal.SIGABRT)
    place = Path(runs.begin()[0])
    (place / "damaged").touch()
    runs.die(signal.SIGABRT)
    assert f"files in {place} may be damaged" in runs.begin()[1]
    assert list(place.iterdir()) == []


def test_a_folder_that_the_user_chose_is_named_and_not_emptied(runs: Runs, tmp_path: Path) -> None:
    runs.die(signal.SIGABRT)
    place, warnings = runs.begin(POCL_CACHE_DIR=str(tmp_path))
    assert place == str(tmp_path)
    assert f"files in {tmp_path} may be damaged; empty that folder" in warnings


def test_a_process_that_was_killed_is_no_crash(runs: Runs) -> None:
    runs.die(signal.SIGKILL)
    assert runs.begin() == ("the usual place", "")
    assert list((runs.cache / "crashes").iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="another system has no XDG_CACHE_HOME")
@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "POCL_CACHE_DIR"])
def test_a_folder_for_caches_that_cannot_be_written_to_is_named(
    variable: str, tmp_path: Path
) -> None:
    """PoCL then has no device, and PyOpenCL ended the run by a KeyError of its own."""
    (tmp_path / "file").write_bytes(b"")
    caches = tmp_path / "file" / "caches"
    done = python("-m", "tactograph", "devices", **{variable: caches})
    assert f"no OpenCL device works here; {caches}, for drivers' programs, cannot" in done.stdout
    assert f"set {variable}=FOLDER" in done.stdout
