"""``tactograph demo`` runs commands that work, in order, in the folder asked for."""

import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

from tactograph.graph.commands.demo import DEMO_STEPS
from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import Command

TABLES = "tactograph.graph.compare.tables"
LINES = [shlex.split(line) for line in DEMO_STEPS.splitlines() if line.startswith("tactograph")]


def test_each_command_is_shown_and_run(
    tactograph: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[list[str]] = []
    monkeypatch.setattr("tactograph.graph.command.run_command", ran.append)
    monkeypatch.setattr(f"{TABLES}.read_rows", lambda _: [])
    folder = tmp_path / "my demo"
    done = tactograph("demo", "--out", folder)
    assert done.code == 0
    shown = [line[2:] for line in done.out.splitlines() if line.startswith("$ ")]
    assert [shlex.split(line)[1:] for line in shown] == ran
    assert f"out={folder}/result" in ran[-2]
    assert "\n\n# RMSE" not in done.out, "lines of one comment stand together"


def test_a_graph_that_fails_fails_the_demo(
    tactograph: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [
        SimpleNamespace(variant="paper", error=""),
        SimpleNamespace(variant="precise", error="E"),
    ]
    monkeypatch.setattr("tactograph.graph.command.run_command", lambda _: None)
    monkeypatch.setattr(f"{TABLES}.read_rows", lambda _: rows)
    done = tactograph("demo", "--out", tmp_path)
    assert (done.code, done.err) == (1, "tactograph: demo: precise failed: E\n")


@pytest.mark.parametrize("words", [line for line in LINES if line[1] == "run"], ids=shlex.join)
def test_each_command_sets_the_params_that_its_graph_needs_and_no_others(words: list[str]) -> None:
    graph = read_graph(words[2])
    stated = {word.partition("=")[0] for word in words if "=" in word}
    needed = {name for name, param in graph.params.items() if param.required}
    assert needed <= stated <= set(graph.params)
