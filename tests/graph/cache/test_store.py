"""Slow results that depend on no stream are stored on disk: complete, checked, as plain data."""

import os
import pickle
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

from tactograph.graph import Port, node
from tactograph.graph.cache import store
from tactograph.graph.cache.store import recall_or_make
from tactograph.graph.disk import disk_cache
from tactograph.graph.errors import InputError, collect_warnings, warn
from tactograph.nodes import F4


class Range(NamedTuple):
    low: float
    high: float


class Table(NamedTuple):
    light: Annotated[F4, Port("H W", "1")]
    range: Range
    rows: tuple[F4, ...]


@node
def tabled(image: Annotated[F4, Port("H W", "1")], *, scale: float = 1.0) -> Table:
    """A table, and its rows one by one."""
    points = image * np.float32(scale)
    return Table(points, Range(float(points.min()), float(points.max())), tuple(points))


IMAGE = np.arange(12, dtype=np.float32).reshape(6, 2)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(store, "MIN_STORED_MS", -1.0)
    return tmp_path / "cache"


def recall(image: F4 = IMAGE, scale: float = 1.0, *, computed: bool) -> Any:
    calls = []

    def make() -> Table:
        calls.append(1)
        result: Table = tabled(image, scale=scale)
        return result

    result = recall_or_make(tabled, {"scale": scale}, [image], make)
    assert bool(calls) == computed
    return result


def files(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


def test_a_computed_result_is_read_the_next_time(folder: Path) -> None:
    first, second = recall(computed=True), recall(computed=False)
    assert isinstance(second, Table)
    np.testing.assert_array_equal(first.light, second.light)
    assert (second.range, second.range.high) == (first.range, 11.0)
    np.testing.assert_array_equal(second.rows, first.rows)


def test_a_result_of_other_inputs_settings_or_code_is_computed_anew(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recall(computed=True)
    recall(IMAGE + 1, computed=True)
    recall(scale=2.0, computed=True)
    recall(computed=False)
    monkeypatch.setattr("tactograph.graph.cache.result_origin.code_of", lambda node: "another")
    recall(computed=True)


def test_another_version_stores_its_own_result_beside_the_first(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recall(computed=True)
    with monkeypatch.context() as other:
        other.setattr(store, "versions", lambda: {"tactograph": "another"})
        recall(computed=True)
        recall(computed=False)
    recall(computed=False)


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "foreign"])
def test_the_result_of_a_damaged_file_is_computed_anew(folder: Path, damage: str) -> None:
    recall(computed=True)
    (file,) = files(folder)
    body = bytearray(file.read_bytes())
    body[-20] ^= 1
    file.write_bytes(
        {"cut": body[:-5], "flipped": body, "empty": b"", "foreign": b"x" * 99}[damage]
    )
    recall(computed=True)
    recall(computed=False)


def test_code_named_in_a_file_is_not_run(folder: Path, tmp_path: Path) -> None:
    recall(computed=True)
    (file,) = files(folder)

    class Bad:
        def __reduce__(self) -> Any:
            return os.mkdir, (str(tmp_path / "obeyed"),)

    import zlib

    body = pickle.dumps(Bad())
    file.write_bytes(disk_cache._FIRST_LINE + f"{zlib.crc32(body):08x}".encode() + b"\n" + body)
    recall(computed=True)
    assert not (tmp_path / "obeyed").exists()


def test_a_fast_result_is_not_stored(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MIN_STORED_MS", 1e6)
    recall(computed=True)
    assert not folder.exists()


def test_a_result_with_an_unknown_object_is_not_stored(folder: Path) -> None:
    recall_or_make(tabled, {}, [IMAGE], lambda: (IMAGE, object()))
    assert not folder.exists() or not files(folder)


def test_a_folder_that_cannot_be_written_does_not_fail_the_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.write_text("a file")
    recall(computed=True)


def test_nothing_is_stored_when_the_cache_is_off(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, "off")
    recall(computed=True)
    recall(computed=True)
    assert not folder.exists()


def test_the_least_recently_read_file_is_deleted_first(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recall(computed=True)
    (first,) = files(folder)
    most = 4 * first.stat().st_size + 8
    monkeypatch.setattr(store, "write_cached", partial(disk_cache.write_cached, most_bytes=most))
    for number in range(1, 4):
        recall(IMAGE + number, computed=True)
    for age, file in enumerate([first, *(f for f in files(folder) if f != first)]):
        os.utime(file, (time.time() - 50 + age,) * 2)
    recall(computed=False)
    recall(IMAGE + 9, computed=True)
    assert len(files(folder)) == 4
    assert first in files(folder)


def test_leftovers_of_a_killed_writer_are_deleted_later(folder: Path) -> None:
    leftover = folder / ".writing-old"
    leftover.mkdir(parents=True)
    (leftover / "a.cached").write_text("half")
    recall(computed=True)
    assert not leftover.exists()


WRITER = """
import sys
from tests.graph.cache.test_store import tabled
from tactograph.graph.disk import disk_cache
from tactograph.graph.cache import store
import numpy as np
store.MIN_STORED_MS = -1.0
image = np.arange(20_000, dtype=np.float32).reshape(-1, 2)
print("begun", flush=True)
for _ in range(int(sys.argv[1])):
    for file in disk_cache.cache_folder().glob("*.cached"):
        file.unlink(missing_ok=True)
    store.recall_or_make(tabled, {}, [image], lambda: tabled(image))
"""


@pytest.mark.slow
def test_two_writers_and_a_kill_leave_complete_files(folder: Path) -> None:
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, count], stdout=subprocess.PIPE)
        for count in ("10000", "4")
    ]
    for writer in writers:
        writer.stdout.readline()
    time.sleep(0.1)
    writers[0].kill()
    assert writers[1].wait(timeout=60) == 0
    writers[0].wait()
    # The killed writer may have deleted the other's file before it wrote its own.
    subprocess.run([sys.executable, "-c", WRITER, "1"], stdout=subprocess.DEVNULL, check=True)
    # Read by a separate process, as pytest changes the bytecode of this module.
    missed = 'lambda: sys.exit("no complete file was left")'
    reader = WRITER.partition("for _")[0] + f"store.recall_or_make(tabled, {{}}, [image], {missed})"
    subprocess.run([sys.executable, "-c", reader], stdout=subprocess.DEVNULL, check=True)
    for writer in writers:
        writer.stdout.close()


def test_a_result_with_a_warning_is_computed_and_warned_about_anew(folder: Path) -> None:
    def make() -> Table:
        warn("half of it is dark")
        result: Table = tabled(IMAGE)
        return result

    for _ in range(2):
        with collect_warnings([]) as messages:
            recall_or_make(tabled, {}, [IMAGE], make)
        assert messages == ["half of it is dark"]


def test_a_node_that_fails_still_gives_its_warnings(folder: Path) -> None:
    def make() -> Table:
        warn("half of it is dark")
        raise InputError("and the rest is too bright")

    with collect_warnings([]) as messages, pytest.raises(InputError):
        recall_or_make(tabled, {}, [IMAGE], make)
    assert messages == ["half of it is dark"]
