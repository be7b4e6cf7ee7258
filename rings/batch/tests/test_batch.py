"""Batches: every capture once and as if it were alone, whatever fails, stops or dies."""

import csv
import multiprocessing
import os
import re
import resource
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import MagicMock

import cv2
import numpy as np
import pyopencl as cl
import pytest
import zarr
from numpy.typing import NDArray

from rings.batch.tests.stores import TAKING, job_of
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.command import run_command
from tactograph.graph.disk.folder_lock import alone_in
from tactograph.graph.files.read_graph import read_graph
from tactograph.rings.batch import map_types
from tactograph.rings.batch.batch import Workers, open_batch, open_chunks
from tactograph.rings.batch.captures import _common_start, find_captures
from tactograph.rings.batch.entry import DONE, FAILED, PENDING, Entry
from tactograph.rings.batch.processes import Processes, do_chunk
from tactograph.rings.batch.run_batch import write_table
from tactograph.rings.batch.store import Store, open_store
from tactograph.rings.batch.worker import Chunk, Tally, Worker
from tests.graph.conftest import Command, Outcome, Write, graph_of, one_line
from tests.nodes.stream.test_layer_kinds import GRAPH as WARM, WARMTH, Lay, ring, write_inputs

__all__ = ["ring"]

LIT = """
format: 1
title: Which pixels are lit
params:
  capture: {kind: path}
  level:   {kind: number, default: 0.5}
  out:     {kind: path, default: out}
prefer: [numpy]
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  lit:    {op: label_lit, in: {light: frames.image}, with: {black: $level}}
outputs: {lit: lit, image: frames.image}
"""
SAVING = LIT.replace(
    "outputs:", "  save: {op: filed, in: {image: frames.image}, with: {folder: $out}}\noutputs:"
)


def make_capture(folder: Path, seed: int, size: tuple[int, int] = (6, 7)) -> Path:
    """Three images of noise."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    for led in (1, 2, 3):
        cv2.imwrite(str(folder / f"led{led}.png"), rng.integers(1, 255, size, np.uint8))
    return folder


def expected(capture: Path, level: float = 0.5) -> NDArray[np.uint8]:
    """The labels of a capture, worked out here."""
    images = [cv2.imread(str(capture / f"led{k}.png"), -1) for k in (1, 2, 3)]
    bits = [(image / np.float32(255) > np.float32(level)) << k for k, image in enumerate(images)]
    return np.asarray(sum(bits), np.uint8)


@pytest.fixture
def captures(tmp_path: Path) -> list[Path]:
    return [make_capture(tmp_path / "day" / f"capture_{n:02}", n) for n in range(7)]


@pytest.fixture
def graph(write: Write) -> str:
    return write(LIT, "lit.yaml")


@pytest.fixture
def saving(toys: list[str], write: Write) -> str:
    """The same graph, which also writes the images into a folder."""
    return write(SAVING, "saving.yaml")


@pytest.fixture
def over(tmp_path: Path) -> str:
    return str(tmp_path / "day" / "*")


def lit(store: Store, number: int) -> NDArray[np.uint8]:
    return store.map("lit", number)


def opened(place: Path | str) -> Store:
    store = open_store(str(place))
    assert store is not None
    return store


@contextmanager
def written_together(captures: int) -> Iterator[None]:
    """Let so many captures be written together."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_types, "MAX_CHUNK_CAPTURES", captures)
        yield


class Batch(NamedTuple):
    """Runs a graph over captures; returns the exit code and stderr."""

    tactograph: Command
    graph: str
    over: str
    captures: list[Path]
    place: Path

    def __call__(self, *more: object, **other: object) -> tuple[int, str]:
        options = {"graph": self.graph, "over": self.over, "out": self.place} | other
        words = (options["graph"], "--over", options["over"], "--out", options["out"])
        with written_together(3):
            outcome = self.tactograph("batch", *words, *more)
        return outcome.code, outcome.err

    @property
    def store(self) -> Store:
        return opened(self.place)


@pytest.fixture
def batch(
    tactograph: Command, graph: str, over: str, captures: list[Path], tmp_path: Path
) -> Batch:
    return Batch(tactograph, graph, over, captures, tmp_path / "out.zarr")


def refusal(outcome: tuple[int, str]) -> str:
    """The line in which a batch that cannot be is refused."""
    return one_line(Outcome(outcome[0], "", outcome[1]))


def begin(
    graph: str, over: str, out: str, workers: Workers | None = None, together: int = 32
) -> Store:
    """A store for captures of which none is done."""
    job = job_of(read_graph(graph), out=out)
    found = find_captures([over]).captures
    with written_together(together):
        return open_batch(job, find_origin(job.graph, {}), found, workers or Worker(job))


def go_on(store: Store, workers: Workers) -> Iterator[Tally]:
    return workers.run(iter(open_chunks(store, retry_failed=False)))


def test_every_capture_is_in_the_store_as_if_it_were_alone(batch: Batch) -> None:
    assert batch() == (0, "")
    store = batch.store
    assert store.captures == list(map(str, batch.captures))
    assert list(store.statuses) == [DONE] * 7
    array = zarr.open_group(str(batch.place), mode="r")["lit"]  # without this package
    assert isinstance(array, zarr.Array)
    assert array.chunks == array.shards, "captures as small as these are read together"
    assert array.attrs["unit"] == "LED bits"
    np.testing.assert_array_equal(np.stack(list(array)), [*map(expected, batch.captures)])
    np.testing.assert_array_equal(lit(store, 6), array[6])


SIZED = """
format: 1
extends: lit.yaml
title: Lit pixels, and their size
patch:
  - {insert: pixel, op: pixel_size, with: {mm: 0.1}}
  - {insert: cells, op: coarsen, in: {light: frames.image}, with: {factor: 2}}
  - {insert: lit_cells, op: label_lit, in: {light: cells}, with: {black: 0.5}}
outputs: {lit_cells: lit_cells, pixel: pixel}
"""


@pytest.mark.slow
def test_xarray_opens_a_store_with_names_units_and_places_in_mm(batch: Batch, write: Write) -> None:
    assert batch(graph=write(SIZED, "sized.yaml")) == (0, "")
    xarray = pytest.importorskip("xarray", reason="'make test-all' installs it")
    found = xarray.open_zarr(batch.place, consolidated=False)
    assert found["lit"].dims == ("capture", "y", "x")
    assert found["lit"].attrs["units"] == "LED bits"
    assert list(found["capture"].values) == list(map(str, batch.captures))
    # From the middle of the image: x right, y down.
    np.testing.assert_allclose(found["x"], [-0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(found["y"], [-0.25, -0.15, -0.05, 0.05, 0.15, 0.25])
    assert found["x"].attrs["units"] == found["y"].attrs["units"] == "mm"
    one = found["lit"].sel(capture=str(batch.captures[2])).sel(x=0.11, y=-0.26, method="nearest")
    assert int(one) == expected(batch.captures[2])[0, 4]
    # A map of another size has dimensions of its own.
    assert found["lit_cells"].dims == ("capture", "lit_cells_y", "lit_cells_x")
    assert int(found["status"].sum()) == 7 * DONE


@pytest.mark.slow
def test_a_store_with_places_takes_more_captures(batch: Batch, write: Write) -> None:
    sized = write(SIZED, "sized.yaml")
    assert batch(graph=sized) == (0, "")
    make_capture(batch.captures[0].with_name("capture_07"), 7)
    assert batch(graph=sized) == (0, "")
    xarray = pytest.importorskip("xarray", reason="'make test-all' installs it")
    found = xarray.open_zarr(batch.place, consolidated=False)
    assert dict(found.sizes) == {"capture": 8, "y": 6, "x": 7, "lit_cells_y": 3, "lit_cells_x": 4}


@pytest.mark.slow
def test_without_a_pixel_size_an_image_has_names_but_no_places(batch: Batch) -> None:
    assert batch() == (0, "")
    xarray = pytest.importorskip("xarray", reason="'make test-all' installs it")
    found = xarray.open_zarr(batch.place, consolidated=False)
    assert found["lit"].dims == ("capture", "y", "x")
    assert {*found.coords} == {"capture"}


def test_a_layer_of_another_package_is_stored(ring: Lay, tmp_path: Path) -> None:
    ring("warmth", WARMTH)
    (tmp_path / "graph.yaml").write_text(WARM)
    height, words = write_inputs(tmp_path)
    store = tmp_path / "batch.zarr"
    over = str(tmp_path / "capture")
    run_command(["batch", *words, "--over", over, "--out", str(store), "--workers", "1"])
    stored: Any = zarr.open_group(store, mode="r")["warmth"]
    np.testing.assert_array_equal(stored[0], height)
    assert stored.attrs["unit"] == "mm"


def test_a_fallback_to_numpy_is_reported_once(batch: Batch, write: Write, no_device: None) -> None:
    graph = write(LIT.replace("[numpy]", "[opencl, numpy]"), "elsewhere.yaml")
    reason = "opencl is preferred, but no OpenCL device works"
    assert batch(graph=graph) == (0, f"fallback: lit runs on numpy: {reason}\n")


def test_a_tilde_is_the_user_s_home(
    tactograph: Command, graph: str, captures: list[Path], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert tactograph("batch", graph, "--over", "~/day/*", "--out", "~/out.zarr").code == 0
    assert opened(tmp_path / "out.zarr").captures == list(map(str, captures))
    assert (tmp_path / "out.csv").is_file()
    assert not (tmp_path / "~").exists()


def test_warnings_are_counted_printed_and_in_the_table(
    tactograph: Command, toys: list[str], write: Write, over: str, captures: list[Path],
    tmp_path: Path,
) -> None:  # fmt: skip
    text = LIT.replace("  lit:", "  seen: {op: noticed, in: {image: frames.image}}\n  lit:")
    graph = write(text.replace("light: frames.image", "light: seen"), "noticing.yaml")
    done = tactograph("batch", graph, "--over", over, "--out", tmp_path / "out.zarr")
    assert (done.code, done.err) == (0, f"warning: {captures[0]} and 6 more: a warning\n")
    assert done.out.endswith("7 done, 0 failed, 7 with warnings\n")
    with (tmp_path / "out.csv").open() as table:
        assert [row["warnings"] for row in csv.DictReader(table)] == ["a warning"] * 7


def test_finished_captures_are_not_run_again(
    batch: Batch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch()
    make_capture(tmp_path / "day" / "capture_99", 99)
    ran: list[str] = []
    attempt = Worker._attempt
    monkeypatch.setattr(
        Worker, "_attempt", lambda self, ready: (ran.append(ready.place), attempt(self, ready))[1]
    )
    batch()
    assert [Path(place).name for place in ran] == ["capture_99"]
    np.testing.assert_array_equal(lit(batch.store, 7), expected(tmp_path / "day" / "capture_99"))


def test_no_process_opens_the_graph_where_nothing_is_left_to_do(
    batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    idle = MagicMock(spec=ProcessPoolExecutor)
    idle.__enter__.return_value = idle
    monkeypatch.setattr("tactograph.rings.batch.processes.start_processes", lambda *_: idle)
    batch("--workers", 1)
    assert batch("--workers", 2) == (0, "")
    assert not idle.submit.called


def test_a_failing_capture_is_reported_and_stops_no_other(batch: Batch, tmp_path: Path) -> None:
    (batch.captures[2] / "led2.png").write_bytes(b"no image")
    code, err = batch()
    assert code == 1
    assert "capture_02/led2.png: not an image" in err
    assert err.count(str(batch.captures[2])) == 1, "its place is named once"
    store = batch.store
    assert list(store.statuses) == [DONE, DONE, FAILED, DONE, DONE, DONE, DONE]
    with (tmp_path / "out.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert [row["status"] for row in rows].count("failed") == 1
    assert "not an image" in rows[2]["reason"]


def test_control_characters_are_escaped_in_the_table(tmp_path: Path) -> None:
    entry = Entry(status=FAILED, reason="a name \x1b[31m of a file")
    write_table(tmp_path / "out.csv", ["c\x1b1"], [entry])
    text = (tmp_path / "out.csv").read_text()
    assert "\x1b" not in text
    assert "a name \\x1b[31m of a file" in text


def test_the_next_capture_is_read_while_one_is_computed(
    batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each capture waits, before it is computed, until the one behind it has been read.

    So does the last of a chunk for the first of the next.
    """
    read = {capture.name: threading.Event() for capture in batch.captures}
    begin, attempt = Worker._read, Worker._attempt

    def note(self: Worker, *about: Any) -> Any:
        ready = begin(self, *about)
        read[Path(ready.place).name].set()
        return ready

    def wait(self: Worker, ready: Any) -> object:
        names = list(read)
        behind = names.index(Path(ready.place).name) + 1
        assert behind == len(names) or read[names[behind]].wait(60)
        return attempt(self, ready)

    monkeypatch.setattr(Worker, "_read", note)
    monkeypatch.setattr(Worker, "_attempt", wait)
    assert batch()[0] == 0


def test_a_chunk_is_written_while_the_next_is_computed(
    batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each chunk but the last waits, before it is written, for a capture of the next."""
    begun = {capture.name: threading.Event() for capture in batch.captures}
    write, attempt = Store.write, Worker._attempt

    def note(self: Worker, ready: Any) -> Any:
        begun[Path(ready.place).name].set()
        return attempt(self, ready)

    def wait(self: Store, entries: dict[int, Entry]) -> None:
        behind = max(entries) + 1
        assert behind == len(batch.captures) or begun[batch.captures[behind].name].wait(60)
        write(self, entries)

    monkeypatch.setattr(Worker, "_attempt", note)
    monkeypatch.setattr(Store, "write", wait)
    assert batch()[0] == 0
    assert batch.store.statuses.tolist() == [DONE] * len(batch.captures)


def test_failed_captures_run_again_only_on_request_and_never_count_as_finished(
    tactograph: Command, batch: Batch
) -> None:
    words = ["batch", batch.graph, "--over", batch.over, "--out", batch.place]
    damaged, number = batch.captures[2] / "led2.png", len(batch.captures)
    whole = damaged.read_bytes()
    damaged.write_bytes(b"no image")
    assert f"{number} captures, 0 of them finished before; " in tactograph(*words).out
    damaged.write_bytes(whole)
    summary = f"{number} captures, {number - 1} of them finished before, 1 failed"
    left = tactograph(*words)
    assert (left.code, f"{summary} (not done again); " in left.out) == (1, True)
    done = tactograph(*words, "--retry-failed")
    assert (done.code, f"{summary} (done again); " in done.out) == (0, True)
    np.testing.assert_array_equal(lit(batch.store, 2), expected(batch.captures[2]))


def test_images_of_another_size_fail_and_leave_the_store(batch: Batch, tmp_path: Path) -> None:
    make_capture(tmp_path / "day" / "capture_99", 99, size=(5, 5))
    code, err = batch()
    assert code == 1
    assert "5 x 5, but the store holds 6 x 7" in err


def test_a_folder_of_captures_is_not_a_capture(batch: Batch, saving: str, tmp_path: Path) -> None:
    over = str(tmp_path / "da*")
    assert "several captures; let --over match each of them" in refusal(batch(over=over))
    code, err = batch(graph=saving, over=over, out=tmp_path / "folders")
    assert (code, "failed: " in err) == (1, True)
    assert not [*tmp_path.glob("folders/**/image.npy")], "nothing is written"


def test_a_folder_of_captures_stands_for_those(batch: Batch, tmp_path: Path) -> None:
    (tmp_path / "day" / "capture.yaml").write_text("sensor: bench 2\n")
    assert batch(over=str(tmp_path / "day")) == (0, "")
    assert batch.store.captures == list(map(str, batch.captures))


def test_files_beside_captures_are_passed_over_and_named(batch: Batch, tmp_path: Path) -> None:
    files = [tmp_path / "day" / name for name in ("grid.png", "notes.txt")]
    for file in files:
        file.write_bytes(b"")
    (tmp_path / "day" / "linked").symlink_to(batch.captures[0])
    code, err = batch()
    assert code == 0
    assert err == "".join(f"warning: {f}: passed over, as it is no folder\n" for f in files)
    linked = str(tmp_path / "day" / "linked")
    assert batch.store.captures == [*map(str, batch.captures), linked]


def test_files_alone_are_captures_and_a_folder_with_files_is_one(captures: list[Path]) -> None:
    files = sorted(map(str, captures[0].iterdir()))
    found = find_captures([str(captures[0] / "*")])
    assert (found.captures, found.passed_over) == (files, [])
    assert find_captures([str(captures[0])]).captures == [str(captures[0])]


@pytest.mark.parametrize(
    ("patterns", "below"),
    [
        (["/a/day1/*"], "/a/day1"),
        (["/a/**/capture_*"], "/a"),
        (["/a/day1/x", "/a/day1/y"], "/a/day1"),
        (["/a/day1/*", "/a/day12/*"], "/a"),
        (["/a/**/b/capture_*", "/a/**/b/*"], "/a"),
        (["/a/../b/*", "/a/../b/c/*"], "/a/../b"),
        (["/a/../b/*", "/a/c/*"], ""),
        (["/*"], ""),
    ],
)
def test_captures_lie_below_the_fixed_part_of_their_pattern(
    patterns: list[str], below: str
) -> None:
    assert _common_start(patterns) == below


@pytest.mark.parametrize(
    ("more", "what"),
    [
        (["level=0.25"], r"other arguments \(level\)"),
        (["--set", "lit.black=0.25"], r"other graph \("),
        (["--maps", "image"], r"was made with other maps \(not given\); give"),
    ],
)
def test_a_store_takes_captures_of_one_kind(batch: Batch, more: list[str], what: str) -> None:
    batch()
    assert re.search(what, refusal(batch(*more)))


def test_a_store_keeps_how_its_captures_are_cut_up(
    batch: Batch, tactograph: Command, graph: str, over: str, tmp_path: Path
) -> None:
    batch()
    make_capture(tmp_path / "day" / "capture_99", 99)
    outcome = tactograph("batch", graph, "--over", over, "--out", batch.place)
    assert (outcome.code, batch.store.chunk) == (0, 3)
    assert list(batch.store.statuses) == [DONE] * 8


def test_a_store_of_another_format_is_refused(batch: Batch) -> None:
    batch()
    about = batch.place / "zarr.json"
    about.write_text(about.read_text().replace('"format": 5', '"format": 1'))
    assert "format 1; this reads 5; give another --out" in refusal(batch())


def test_a_changed_file_behind_the_same_name_is_another_job(tmp_path: Path, write: Write) -> None:
    graph = read_graph(
        write(LIT.replace("  level:", "  notes:   {kind: path, default: null}\n  level:"))
    )
    notes = tmp_path / "notes"
    job, identities = job_of(graph, {"notes": str(notes)}), []
    for text in ("one", "another"):
        notes.write_text(text)
        identities.append(job.identity(find_origin(graph, job.arguments)))
    assert identities[0] != identities[1]


def test_a_chunk_that_was_half_written_is_done_again(
    graph: str, over: str, captures: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    merge = Store._merge

    def dies(self: Store, name: str, values: dict[int, object]) -> None:
        if name == "status" and min(values) == 3:
            raise KeyboardInterrupt
        merge(self, name, values)

    out = str(tmp_path / "out.zarr")
    store = begin(graph, over, out, together=3)
    monkeypatch.setattr(Store, "_merge", dies)
    with pytest.raises(KeyboardInterrupt):
        list(go_on(store, Worker(job_of(read_graph(graph), out=out))))
    assert list(opened(out).statuses) == [DONE] * 3 + [PENDING] * 4
    monkeypatch.setattr(Store, "_merge", merge)
    store = begin(graph, over, out)
    list(go_on(store, Worker(job_of(read_graph(graph), out=out))))
    assert list(store.statuses) == [DONE] * 7
    np.testing.assert_array_equal(lit(store, 4), expected(captures[4]))


def test_results_may_go_into_folders(batch: Batch, saving: str, tmp_path: Path) -> None:
    assert batch(graph=saving, out=tmp_path / "folders") == (0, "")
    for capture in batch.captures:
        folder = tmp_path / "folders" / capture.name
        np.testing.assert_array_equal(np.load(folder / "image.npy").shape, (3, 6, 7))
    assert (tmp_path / "folders" / "captures.csv").is_file()
    read = sorted((tmp_path / "day").rglob("*"))
    for out in (tmp_path / "day", batch.captures[0]):
        assert f"--out {out}: is what --over {out} reads" in refusal(batch(graph=saving, out=out))
    assert sorted((tmp_path / "day").rglob("*")) == read


def test_folders_of_results_lie_where_the_first_batch_put_them(
    batch: Batch, saving: str, tmp_path: Path
) -> None:
    out = tmp_path / "folders"
    assert batch(graph=saving, over=str(tmp_path / "**" / "capture_00"), out=out) == (0, "")
    assert batch(graph=saving, over=str(tmp_path / "day" / "*"), out=out) == (0, "")
    assert {f.parent.name for f in (out / "day").glob("*/image.npy")} == {
        c.name for c in batch.captures
    }
    elsewhere = make_capture(tmp_path.parent / f"{tmp_path.name}_other" / "capture_00", 1)
    assert f"lie below {tmp_path}" in refusal(batch(graph=saving, over=str(elsewhere), out=out))
    assert len(opened(out / "batch.zarr")) == 7


@pytest.mark.parametrize("over", ["day/../day/*", "day/"])
def test_folders_of_results_are_called_as_the_captures_however_these_are_reached(
    batch: Batch, saving: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, over: str
) -> None:
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "folders"
    assert batch(graph=saving, over=over, out=out) == (0, "")
    assert {f.parent for f in out.glob("**/image.npy")} == {out / c.name for c in batch.captures}


def test_folders_need_a_graph_that_writes(batch: Batch, write: Write, tmp_path: Path) -> None:
    graph = write(LIT.replace("  out:     {kind: path, default: out}\n", ""), "lit.yaml")
    assert "else give a store, NAME.zarr" in refusal(batch(graph=graph, out=tmp_path / "folders"))


def test_a_folder_that_is_not_a_store_is_not_written_into(batch: Batch, tmp_path: Path) -> None:
    zarr.create_group(str(tmp_path / "other.zarr"))
    assert "no store of a batch" in refusal(batch(out=tmp_path / "other.zarr"))


def test_two_batches_do_not_work_in_one_store_at_once(batch: Batch) -> None:
    with alone_in(batch.place):
        assert "another process is at work in it" in refusal(batch())
    assert not batch.place.exists(), "nothing came into it"
    assert batch() == (0, "")


def test_a_mistake_in_the_first_command_leaves_nothing_that_stops_the_second(batch: Batch) -> None:
    message = refusal(batch(over=str(batch.captures[0] / "led1.png")))
    assert message.startswith("tactograph: the capture cannot be processed: ")
    assert batch("level=0.25") == (0, "")
    assert batch.store.captures == list(map(str, batch.captures))


def test_a_batch_does_not_take_its_own_store_for_a_capture(batch: Batch, tmp_path: Path) -> None:
    out = tmp_path / "day" / "out.zarr"
    for _ in range(2):
        assert batch(out=out) == (0, "")
    assert opened(out).captures == list(map(str, batch.captures))
    assert "it holds nothing but --out" in refusal(batch(over=f"{out}*", out=out))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--maps", "lid"], "did you mean 'lit'"),
        (["capture=x"], "in a batch --over says that"),
        (["out=x"], "in a batch --out says that"),
        (["--over", ""], "--over is empty"),
        (["--over", "none*"], "--over none*: nothing is there"),
        (["--out", " "], "--out is empty"),
        (["--out", "results", "--maps", "lit"], "--maps lit: what a store keeps (--out NAME.zarr)"),
    ],
)
def test_contradictory_options_are_refused_before_a_store_exists(
    batch: Batch, words: list[str], message: str
) -> None:
    code, err = batch(*words)
    assert code == 2
    assert message in err
    assert not batch.place.exists()


@pytest.fixture
def killer() -> Iterator[list[int]]:
    """Kill a child of this process once; return whom."""
    killed: list[int] = []
    stop = threading.Event()

    def kill() -> None:
        while not killed and not stop.wait(1.0):
            for child in multiprocessing.active_children()[:1]:
                if child.pid is not None:
                    os.kill(child.pid, signal.SIGKILL)
                    killed.append(child.pid)

    thread = threading.Thread(target=kill)
    thread.start()
    yield killed
    stop.set()
    thread.join()


def test_captures_survive_dead_processes(graph: str, tmp_path: Path, killer: list[int]) -> None:
    made = [make_capture(tmp_path / "many" / f"{n:03}", n) for n in range(60)]
    out = str(tmp_path / "out.zarr")
    workers = Processes(job_of(read_graph(graph), out=out), 2)
    store = begin(graph, str(tmp_path / "many" / "*"), out, workers, together=2)
    start = time.monotonic()
    done = 0
    for tally in go_on(store, workers):
        done += tally.done
        while len(killer) < 1 and time.monotonic() - start < 20:
            time.sleep(0.05)
    assert killer, "nobody was killed; the test says nothing"
    assert done == 60
    for number, capture in enumerate(made):
        np.testing.assert_array_equal(lit(store, number), expected(capture))


@pytest.mark.parametrize("fails_at", ["a map", "a word"])
def test_a_batch_resumes_after_a_full_disk_which_it_reports(
    graph: str, over: str, captures: list[Path], tmp_path: Path, tactograph: Command,
    monkeypatch: pytest.MonkeyPatch, fails_at: str,
) -> None:  # fmt: skip
    """A limit for files stands in for the disk, which both fail in the system's own way."""
    merge = Store._merge

    def limited(self: Store, name: str, *rest: Any) -> None:
        is_map = name in self.types
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        if is_map == (fails_at == "a map"):
            resource.setrlimit(resource.RLIMIT_FSIZE, (8, hard))
        try:
            merge(self, name, *rest)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    command = ("batch", graph, "--over", over, "--out", str(tmp_path / "out.zarr"))
    monkeypatch.setattr(Store, "_merge", limited)
    message = one_line(tactograph(*command))
    assert "out.zarr: cannot be written: File too large" in message
    assert "once that is mended the same command goes on" in message
    assert not (opened(tmp_path / "out.zarr").statuses == DONE).any()
    monkeypatch.setattr(Store, "_merge", merge)
    assert tactograph(*command).code == 0
    assert opened(tmp_path / "out.zarr").statuses.tolist() == [DONE] * len(captures)


def reported(chunk: Chunk) -> Tally:
    """Do nothing; say how many captures there are."""
    return Tally(len(chunk))


def test_no_chunk_is_lost_when_a_process_dies_between_two(tmp_path: Path) -> None:
    chunks = [[(n, f"{n}")] for n in range(4)]
    done = 0
    for tally in Processes(job_of(graph_of(TAKING)), 1, reported).run(chunks):
        done += tally.done
        if done == 1:
            (idle,) = multiprocessing.active_children()
            idle.kill()
            idle.join()
            time.sleep(0.5)
    assert done == 4


def poisoned(chunk: Chunk) -> Tally:
    """Do a chunk, unless it holds capture 3, which ends the process."""
    if any(number == 3 for number, _ in chunk):
        os.kill(os.getpid(), signal.SIGKILL)
    return do_chunk(chunk)


def test_a_capture_that_kills_its_process_is_found_out(
    graph: str, over: str, captures: list[Path], tmp_path: Path
) -> None:
    out = str(tmp_path / "out.zarr")
    workers = Processes(job_of(read_graph(graph), out=out), 2, poisoned)
    store = begin(graph, over, out, workers, together=1)
    list(go_on(store, workers))
    assert list(store.statuses) == [DONE, DONE, DONE, FAILED, DONE, DONE, DONE]
    assert "its process died" in store.read_all()[3].reason


def spoil_chunk(store: Path, name: str) -> None:
    """Overwrite the middle of an array's first chunk."""
    file = store / name / "c" / "0"
    file = file if file.is_file() else next(f for f in file.rglob("*") if f.is_file())
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 8] = os.urandom(8)
    file.write_bytes(content)


def lose_chunk(store: Path, name: str) -> None:
    shutil.rmtree(store / name / "c" / "0")


def lose_array(store: Path, name: str) -> None:
    shutil.rmtree(store / name)


@pytest.mark.parametrize(
    ("damage", "again"), [(spoil_chunk, "finished capture"), (lose_chunk, "3"), (lose_array, "7")]
)
def test_damaged_results_that_count_as_done_are_computed_again(batch: Batch, damage, again) -> None:
    batch()
    damage(batch.place, "lit")
    code, err = batch()
    assert code == 0
    assert f"{again}" in err
    assert "damaged: done again" in err
    for number, capture in enumerate(batch.captures):
        np.testing.assert_array_equal(lit(batch.store, number), expected(capture))
    assert batch() == (0, "")


@pytest.mark.parametrize(
    ("lost", "message"),
    [("capture", "'capture' is missing"), ("capture/c/0", "'capture' lacks 3 of 7 names")],
)
def test_a_store_without_names_of_captures_is_refused(
    batch: Batch, lost: str, message: str
) -> None:
    batch()
    (batch.place / lost).rename(batch.place.with_name("lost"))
    assert f"{message}; remove it, or give another --out" in refusal(batch())


def test_captures_that_were_half_added_are_added_again(
    batch: Batch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch()
    make_capture(tmp_path / "day" / "capture_99", 99)
    resize = zarr.Array.resize

    def stop(array: Any, shape: Any) -> None:
        if array.basename == "reason":
            raise KeyboardInterrupt
        resize(array, shape)

    with monkeypatch.context() as patch:
        patch.setattr(zarr.Array, "resize", stop)
        assert batch()[0] == 130
    assert batch.store.captures == list(map(str, batch.captures))
    assert len(batch.store.read_all()) == 7
    assert batch() == (0, "")
    assert batch.store.captures[7].endswith("capture_99")
    np.testing.assert_array_equal(lit(batch.store, 7), expected(tmp_path / "day" / "capture_99"))


def test_a_name_that_is_not_text_is_refused_before_there_is_a_store(
    batch: Batch, tmp_path: Path
) -> None:
    batch.captures[2].rename(batch.captures[2].with_name(os.fsdecode(b"bad\xff")))
    assert r"day/bad\udcff': the name is not UTF-8; rename it" in refusal(batch())
    assert not batch.place.exists()
    out = tmp_path / os.fsdecode(b"out\xff.zarr")
    assert "the name is not UTF-8; rename it" in refusal(
        batch(over=str(batch.captures[0]), out=out)
    )


def test_a_store_that_speaks_of_endless_captures_is_refused_unread(batch: Batch) -> None:
    batch()
    for about in batch.place.glob("*/zarr.json"):
        about.write_text(
            re.sub(r'("shape":\s*\[\s*)7', r"\g<1>1000000000000", about.read_text(), count=1)
        )
    assert "is damaged" in refusal(batch())


def test_removed_results_are_computed_again(batch: Batch, saving: str, tmp_path: Path) -> None:
    place = tmp_path / "out"
    batch(graph=saving, out=place)
    removed = place / batch.captures[2].name
    shutil.rmtree(removed)
    code, err = batch(graph=saving, out=place)
    assert (code, "1 finished capture damaged" in err) == (0, True)
    assert (removed / "image.npy").is_file()


def test_a_device_that_fails_late_costs_one_capture_and_is_opened_again(
    batch: Batch, toys: list[str], write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = LIT.replace("prefer: [numpy]", "prefer: [opencl]")
    finish, opened_pipelines = OpenCL.finish, []

    def fail_at_the_third(self: OpenCL) -> None:
        opened_pipelines.append(self)
        if len(opened_pipelines) == 3:
            raise cl.RuntimeError("clFinish failed: OUT_OF_RESOURCES")
        finish(self)

    monkeypatch.setattr(OpenCL, "finish", fail_at_the_third)
    code, err = batch(graph=write(text, "lit.yaml"))
    assert code == 1
    assert "OUT_OF_RESOURCES" in err
    store = batch.store
    assert sorted(store.statuses) == [DONE] * 6 + [FAILED]
    assert len({id(each) for each in opened_pipelines}) == 2
