"""``--with`` on the command line, and studies among its graphs."""

import csv
import json
from pathlib import Path

import pytest

from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import STREAM, Command, Write, one_line

FEW = "format: 1\ntitle: one touch\nparams: {count: {kind: integer, default: 1}}"
TOUCHED = """
format: 1
title: and where the film is touched
patch:
  - insert: touched
    op: find_contact
    in: {height: integrate.height}
    with: {enter: $enter, leave: $leave}
outputs: {touched: touched}
"""
STUDY = """
format: 1
title: How many touches
base: graph.yaml
variants:
  dim: {patch: [{insert: dim, op: dimmed, in: {image: frames.image}}]}
  one: {extends: few.yaml}
"""


@pytest.fixture
def stream(write: Write, toys: list[str]) -> str:
    write(FEW, "few.yaml")
    return write(STREAM)


@pytest.mark.parametrize("command", ["check", "explain"])
def test_a_graph_is_shown_with_its_overlays(tactograph: Command, command: str) -> None:
    done = tactograph(command, "reconstruct", "--with", "no_flat", "--with", "follow_drift")
    assert done.code == 0, done.err
    assert "reconstruct_no_flat_follow_drift" in done.out
    assert read_graph("reconstruct_no_flat_follow_drift").hash in done.out


def test_an_overlay_is_applied_before_set_and_adds_its_params(
    tactograph: Command, write: Write
) -> None:
    words = ("paper", "--with", write(TOUCHED, "touched.yaml"), "--set", "touched.enter=9")
    done = tactograph("resolve", *words)
    assert read_graph(write(done.out)).nodes["touched"].settings["enter"] == 9
    assert "find_contact" in tactograph("draw", *words).out
    assert "leave=NUMBER" in tactograph("run", *words, "--help").out


def test_an_overlay_that_does_not_fit_ends_in_one_line(tactograph: Command) -> None:
    message = one_line(tactograph("run", "paper", "--with", "follow_drift"))
    assert message.startswith("tactograph: 'follow_drift' does not fit paper: ")


def test_a_graph_is_run_with_an_overlay_of_the_user(
    tactograph: Command, stream: str, toys: list[str]
) -> None:
    assert tactograph("run", stream, "--with", str(Path(stream).with_name("few.yaml"))).code == 0
    assert [line for line in toys if line.startswith("noted")] == ["noted 1"]


def test_a_study_is_checked_graph_by_graph(tactograph: Command, stream: str, write: Write) -> None:
    done = tactograph("check", write(STUDY.replace("dimmed", "noted"), "study.yaml"))
    heads = [line.partition(":")[0] for line in done.out.splitlines() if "[" in line]
    assert heads == ["graph", "graph_dim", "graph_one"]


def test_a_study_is_compared_variant_by_variant(
    tactograph: Command, stream: str, write: Write, tmp_path: Path
) -> None:
    study = write(STUDY.replace("dimmed", "noted"), "study.yaml")
    done = tactograph("compare", study, "--backends", "numpy", "--out", str(tmp_path / "report"))
    assert done.code == 0, done.err
    with (tmp_path / "report" / "table.csv").open() as table:
        assert {row["variant"] for row in csv.DictReader(table)} == {
            "graph", "graph_dim", "graph_one",
        }  # fmt: skip


def test_compare_applies_an_overlay_to_every_graph(
    tactograph: Command, stream: str, write: Write, tmp_path: Path
) -> None:
    few, out = str(Path(stream).with_name("few.yaml")), tmp_path / "report"
    other = write(STREAM, "other.yaml")
    done = tactograph("compare", stream, other, "--with", few, "--out", str(out))
    assert done.code == 0, done.err
    rows = json.loads((out / "table.json").read_text())
    assert "graph_few" in json.dumps(rows)
    assert "other_few" in json.dumps(rows)


def test_a_study_is_not_run(tactograph: Command) -> None:
    message = one_line(tactograph("run", "reconstruct_ablation"))
    assert "is a study; 'tactograph compare reconstruct_ablation' runs all its graphs" in message
