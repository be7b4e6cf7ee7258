"""Warnings at a stream's end reach its reader."""

import json
from pathlib import Path

import pytest

from tactograph.graph.run.open_pipeline import open_pipeline
from tests.graph.conftest import STREAM, Command, Write

CUT = STREAM.replace("op: touches", "op: cut_touches").replace("op: noted", "op: stored")
BOTH = ["cut short", "the disk is full"]


@pytest.fixture
def graph(toys: list[str], write: Write) -> str:
    return write(CUT, "cut.yaml")


def test_closing_warnings_stay_until_the_next_stream(graph: str) -> None:
    with open_pipeline(graph, {"count": 2}) as pipeline:
        assert [result.warnings for result in pipeline.items()] == [[], []]
        assert pipeline.closing_warnings == BOTH
        stream = pipeline.items()
        next(stream)
        assert pipeline.closing_warnings == []
        stream.close()
        assert pipeline.closing_warnings == BOTH[1:], "left before its end"


def test_run_prints_and_counts_them_even_without_items(graph: str, tactograph: Command) -> None:
    done = tactograph("run", graph, "--backend", "numpy")
    assert done.err.splitlines() == [f"warning: {text}" for text in BOTH]
    assert done.out.endswith("2 warnings, see above\n")
    done = tactograph("run", graph, "count=0", "--backend", "numpy")
    assert (done.code, done.err.splitlines()[0]) == (2, "warning: cut short")


def test_a_comparison_has_it(graph: str, tactograph: Command, tmp_path: Path) -> None:
    out = tmp_path / "report"
    assert tactograph("compare", graph, "--out", out).code == 0
    (row,) = json.loads((out / "table.json").read_text())
    assert row["warnings"] == BOTH
