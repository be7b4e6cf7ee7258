"""Variants side by side: every cell is run, kept, and told."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from tactograph.graph import InputError, compare, run
from tactograph.graph.compare import make_jobs, run_job, write_tables
from tactograph.graph.read import read_graph
from tests.graph.conftest import Command, Write

GRAPH = """
format: 1
params:
  capture: {kind: text}
  level: {kind: number, default: 1}
prefer: [numpy]
nodes:
  frames: {op: touches, with: {count: 1}}
  cal:    {op: at_rest, with: {level: $level}}
  light:  {op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark}}
  more:   {op: doubled, in: {image: light}}
  score:  {op: watched, in: {image: more, truth: frames.truth}}
outputs: {score: score}
"""
VARIANT = "format: 1\nextends: first.yaml\npatch: [{set: frames, with: {count: 2}}]"
FAILING = (
    "format: 1\nextends: first.yaml\npatch: [{replace: more, op: failing, in: {image: light}}]"
)


@pytest.fixture
def captures(tmp_path: Path) -> list[Path]:
    folders = [tmp_path / "captures" / name for name in ("a", "b")]
    for folder in folders:
        folder.mkdir(parents=True)
    return folders


@pytest.fixture
def graphs(toys: list[str], write: Write) -> list[str]:
    return [
        write(GRAPH, "first.yaml"), write(VARIANT, "second.yaml"), write(FAILING, "third.yaml")
    ]  # fmt: skip


def table(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads((folder / "table.json").read_text())
    return rows


def test_every_variant_runs_on_every_capture_on_every_back_end(
    graphs: list[str], captures: list[Path], tmp_path: Path, tactograph: Command
) -> None:
    out = tmp_path / "report"
    done = tactograph(
        "compare", *graphs[:2], "--over", captures[0], "--over", captures[1],
        "--backends", "numpy,opencl", "--out", out,
    )  # fmt: skip
    assert done.code == 0, done.err
    rows = table(out)
    assert len(rows) == 8
    assert {(row["variant"], row["capture"], row["backend"]) for row in rows} == {
        (v, c, b) for v in ("first", "second") for c in "ab" for b in ("numpy", "opencl")
    }
    assert rows[0]["figures"] == {"mean": 2.0, "truth": 1.0}
    assert set(rows[0]["milliseconds"]) == {"light", "more", "score"}
    assert rows[1]["backends"]["light"] == "opencl"
    with (out / "table.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["mean"]) for line in lines] == [row["figures"]["mean"] for row in rows]


def test_what_was_finished_is_not_run_again(
    graphs: list[str], captures: list[Path], tmp_path: Path, toys: list[str]
) -> None:
    (job,) = make_jobs([read_graph(graphs[0])], captures[:1], ["numpy"])
    first = run_job(job, {}, tmp_path / "report", None)
    toys.clear()
    assert run_job(job, {}, tmp_path / "report", None) == first
    assert toys == []


@pytest.mark.parametrize("what", ["value", "graph", "back end", "damaged", "device"])
def test_what_has_changed_is_run_again(
    graphs: list[str],
    captures: list[Path],
    tmp_path: Path,
    toys: list[str],
    write: Write,
    what: str,
) -> None:
    (job,) = make_jobs([read_graph(graphs[0])], captures[:1], ["numpy"])
    run_job(job, {}, tmp_path / "report", None)
    toys.clear()
    given: dict[str, Any] = {}
    device = None
    if what == "value":
        given = {"level": 2}
    elif what == "graph":
        graph = read_graph(write(GRAPH.replace("count: 1", "count: 3"), "first.yaml"))
        (job,) = make_jobs([graph], captures[:1], ["numpy"])
    elif what == "back end":
        (job,) = make_jobs([read_graph(graphs[0])], captures[:1], ["opencl"])
    elif what == "device":
        device = "e"
    else:
        (job.folder(tmp_path / "report") / "row.json").write_text('{"half')
    assert run_job(job, given, tmp_path / "report", device).error == ""
    assert "touch 1" in toys


@pytest.mark.parametrize("failure", ["a node", "the engine"])
def test_a_run_that_fails_does_not_end_the_rest(
    graphs: list[str],
    captures: list[Path],
    tmp_path: Path,
    tactograph: Command,
    monkeypatch: pytest.MonkeyPatch,
    failure: str,
) -> None:
    if failure == "the engine":
        ordinary = run.open_pipeline

        def broken(graph: Any, *args: Any, **keywords: Any) -> Any:
            if graph.name == "third":
                raise RuntimeError("a careless node")
            return ordinary(graph, *args, **keywords)

        monkeypatch.setattr(compare, "open_pipeline", broken)
    out = tmp_path / "report"
    done = tactograph("compare", graphs[2], graphs[0], "--over", captures[0], "--out", out)
    assert done.code == 0, done.err
    assert "failed: third on a: " in done.out
    assert "a careless node" in done.out
    rows = table(out)
    assert [bool(row["error"]) for row in rows] == [True, False]
    assert not (out / "third" / "preferred" / "a" / "row.json").exists()


def test_if_every_run_fails_the_command_fails(
    graphs: list[str], captures: list[Path], tmp_path: Path, tactograph: Command
) -> None:
    done = tactograph("compare", graphs[2], "--over", captures[0], "--out", tmp_path / "report")
    assert done.code == 2
    assert done.err == "tactograph: every run failed; the reasons are above\n"


def test_a_fallback_is_told(
    graphs: list[str],
    captures: list[Path],
    tmp_path: Path,
    tactograph: Command,
    write: Write,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(run, "choose_device", lambda text=None: (None, "no OpenCL device works"))
    graph = write(GRAPH.replace("prefer: [numpy]\n", ""), "first.yaml")
    done = tactograph("compare", graph, "--over", captures[0], "--out", tmp_path / "report")
    line = "light runs on numpy: opencl is preferred, but no OpenCL device works"
    assert f"fallback: first: {line}" in done.out
    assert table(tmp_path / "report")[0]["fallbacks"] == [line]


def test_two_captures_of_one_name_are_refused(
    graphs: list[str], captures: list[Path], tmp_path: Path
) -> None:
    (tmp_path / "more" / "a").mkdir(parents=True)
    with pytest.raises(InputError, match="two of the runs are called first/numpy/a"):
        make_jobs([read_graph(graphs[0])], [captures[0], tmp_path / "more" / "a"], ["numpy"])


def test_a_capture_is_named_by_its_folder_however_it_is_reached(
    graphs: list[str], captures: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(captures[0])
    (job,) = make_jobs([read_graph(graphs[0])], [Path()], [None])
    assert job.folder(Path("out")) == Path("out/first/preferred/a")


def test_a_name_in_brackets_is_printed_as_it_is(
    graphs: list[str], tmp_path: Path, tactograph: Command
) -> None:
    folder = tmp_path / "[red] [bold]"
    folder.mkdir()
    done = tactograph("compare", graphs[0], "--over", folder, "--out", tmp_path / "report")
    assert done.code == 0, done.err
    assert "[red] [bold]" in done.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--over", "nowhere"), "--over nowhere: there is no such folder"),
        (("--over", ".", "--backends", "cuda"), "--backends cuda: there are numpy and opencl"),
        (("--over", ".", "levle=1"), "no parameter 'levle'; did you mean 'level'?"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(
    graphs: list[str],
    toys: list[str],
    tactograph: Command,
    tmp_path: Path,
    words: tuple[str, ...],
    message: str,
) -> None:
    done = tactograph("compare", graphs[0], *words, "--out", tmp_path / "report")
    assert done.code == 2
    assert message in done.err
    assert toys == []
    assert not (tmp_path / "report").exists()


def test_tables_appear_whole_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "report").write_text("a file is in the way")
    with pytest.raises(InputError, match="cannot be written"):
        write_tables([], tmp_path / "report")
