"""``explain`` says how long each step took before, where that is known, and runs nothing."""

import json
import os
from pathlib import Path

import pytest

from tests.graph.conftest import SLOPES, Command, one_line, tactograph

__all__ = ["tactograph"]
KEPT = SLOPES.replace("height map}\n", "height map}\n  out: {kind: path, default: out}\n")
UNKNOWN = "how long: not known; run it, or give"


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A graph of the host whose results lie in ``out``."""
    monkeypatch.chdir(tmp_path)
    Path("graph.yaml").write_text(KEPT.replace("nodes:", "prefer: [numpy]\nnodes:"))
    return "graph.yaml"


def result(folder: str, name: str = "graph", ms: float = 12.5, backend: str = "numpy") -> None:
    """A result of a graph of that name, in which ``slope`` took so long."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    nodes = [{"node": "slope", "backend": backend, "ms": ms}]
    said = {"graph": {"name": name}, "device": "another", "nodes": nodes}
    (Path(folder) / "result.json").write_text(json.dumps(said))


def test_times_are_those_of_the_last_result(graph: str, tactograph: Command) -> None:
    assert UNKNOWN in tactograph("explain", graph).out
    result("out")
    done = tactograph("explain", graph, "file=no_such_file.npy")
    assert done.code == 0, done.err
    (row,) = (line for line in done.out.splitlines() if line.startswith("│ slope"))
    assert "│ 12.50 " in row
    assert "how long: 0.0 ms an item and 12.5 ms once, as out/result.json says" in done.out
    assert "says; not known: height, pixel, again\n" in done.out


def test_of_a_stream_the_newest_result_counts(graph: str, tactograph: Command) -> None:
    for age, name in enumerate(("b", "a")):
        result(f"out/{name}", ms=10.0 + age)
        os.utime(f"out/{name}/result.json", (100 + age, 100 + age))
    assert "11.0 ms once, as out/a/result.json says" in tactograph("explain", graph).out


@pytest.mark.parametrize("other", [{"name": "paper"}, {"backend": "opencl"}])
def test_times_of_another_graph_or_place_do_not_count(
    graph: str, tactograph: Command, other: dict[str, str]
) -> None:
    result("out", **other)  # type: ignore[arg-type]
    assert UNKNOWN in tactograph("explain", graph).out


def test_what_a_bench_wrote_counts(graph: str, tactograph: Command) -> None:
    nodes = [{"node": "again", "backend": "numpy", "ms": 3.0}]
    Path("bench.json").write_text(json.dumps([{"device": "numpy", "graph": "0", "nodes": nodes}]))
    said = tactograph("explain", graph, "--times", "bench.json").out
    assert "3.0 ms once, as bench.json says" in said


@pytest.mark.parametrize("text", ["no JSON", "[1]", "{}", '{"nodes": [{}]}', "null"])
def test_a_file_without_times_is_refused_if_it_was_asked_for(
    graph: str, tactograph: Command, text: str
) -> None:
    Path("out").mkdir()
    Path("out/result.json").write_text(text)
    assert tactograph("explain", graph).code == 0
    said = one_line(tactograph("explain", graph, "--times", "out"))
    assert "out/result.json: holds no times; give" in said


def test_a_step_that_may_be_taken_from_disk_is_marked(
    graph: str, tactograph: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TACTOGRAPH_CACHE", str(tmp_path / "cache"))
    assert "unless on disk" not in tactograph("explain", graph).out
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "height_slopes-0.kept").touch()
    marked = [line for line in tactograph("explain", graph).out.splitlines() if "unless" in line]
    assert [line.split()[1] for line in marked] == ["slope"]
