"""The present stage is shown on a terminal, and in a pipe now and then."""

import io
import sys
import threading
from pathlib import Path

import pytest

from tactograph.graph.commands import progress_line
from tactograph.graph.commands.progress_line import ProgressLine
from tactograph.graph.files import read_graph
from tests.graph.conftest import STREAM, Command


class Terminal(io.StringIO):
    """Remembers what was written, and when a word comes, behind another one if need be."""

    def __init__(self, word: str, behind: str = "") -> None:
        super().__init__()
        self._word, self._behind = word, behind
        self.came = threading.Event()

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        written = super().write(text)
        start = self.getvalue().find(self._behind)
        if start >= 0 and self._word in self.getvalue()[start:]:
            self.came.set()
        return written


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(progress_line, "MIN_SHOWN_S", 0.0)
    monkeypatch.setattr(progress_line, "REDRAW_INTERVAL_S", 0.001)
    monkeypatch.setenv("TACTOGRAPH_CACHE", str(tmp_path / "cache"))


def shown(monkeypatch: pytest.MonkeyPatch, line_of: str, word: str, key: str = "one") -> str:
    """The output of a run in one stage on a terminal, once a word had come."""
    terminal = Terminal(word, behind=line_of)
    monkeypatch.setattr(sys, "stderr", terminal)
    with ProgressLine() as line:
        line.recall(key)
        line.stage_of = lambda: line_of
        assert terminal.came.wait(60)
        line.end()
        line.keep(key)
    return terminal.getvalue()


def test_a_first_run_shows_its_stage_and_time_and_a_second_one_the_time_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = shown(monkeypatch, "model (fit_film)", " 0 s")
    assert "model (fit_film)" in first
    assert "s left" not in first
    assert "model (fit_film)" in shown(monkeypatch, "model (fit_film)", "s left")


def test_another_graph_s_times_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    shown(monkeypatch, "model", "model", key="one")
    assert "s left" not in shown(monkeypatch, "model", "model", key="another")


def test_the_time_left_is_what_the_last_run_took_from_this_stage_on() -> None:
    line = ProgressLine(wanted=False)
    line._before = {"read": 0.0, "fit": 4.0, "": 10.0}
    line._begun = {"read": 0.0, "fit": 5.0}
    assert line.left("fit", 7.0) == pytest.approx(4)
    assert line.left("a stage that was too short to be seen", 8.0) == pytest.approx(3)
    assert line.left("fit", 20.0) is None
    line.forget_times()
    assert line.left("fit", 7.0) is None


def test_a_run_at_another_pace_than_the_last_shows_no_time_left() -> None:
    line = ProgressLine(wanted=False)
    line._before = {"read": 0.0, "fit": 4.0, "rank": 5.0, "": 10.0}
    line._begun = {"read": 0.0, "fit": 5.0, "rank": 30.0}
    assert line.left("fit", 6.0) == pytest.approx(5)
    assert line.left("rank", 31.0) is None


def test_a_run_that_found_its_results_on_disk_is_not_what_the_next_is_measured_by(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for taken, kept in ((60.0, 60.0), (3.0, 60.0), (90.0, 90.0)):
        line = ProgressLine()
        line.recall("one")
        monkeypatch.setattr(line, "_start", line._start - taken)
        line.keep("one")
        line.recall("one")
        assert line._before[""] == pytest.approx(kept, abs=1)


def test_of_many_captures_the_time_left_follows_from_the_share_that_is_done() -> None:
    line = ProgressLine(wanted=False)
    line.at("1 of 4 captures", 1 / 4)
    assert line.left(line.stage_of(), 5.0) == pytest.approx(15)


@pytest.mark.parametrize("quiet", [False, True])
def test_run_shows_it_on_a_terminal_unless_it_is_to_be_quiet(
    about: Command, monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    terminal, read = Terminal("reading and compiling"), read_graph.read_graph

    def wait_and_read(graph: str) -> object:
        if not quiet:
            assert terminal.came.wait(60)
        return read(graph)

    monkeypatch.setattr(read_graph, "read_graph", wait_and_read)
    monkeypatch.setattr(sys, "stderr", terminal)
    assert about("run", STREAM, "--backend", "numpy", *["--quiet"] * quiet).code == 0
    assert ("reading and compiling" in terminal.getvalue()) != quiet


def test_a_pipe_gets_a_line_now_and_then(
    about: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert about("run", STREAM, "--backend", "numpy").err == ""
    monkeypatch.setattr(progress_line, "PRINT_INTERVAL_S", 0.01)
    told = ""
    with ProgressLine() as line:
        line.stage_of = lambda: "model (fit_film)"
        while told.count("model (fit_film): 0 s\n") < 2:
            told += capsys.readouterr().err


def test_quiet_keeps_what_nodes_print_to_themselves(about: Command) -> None:
    words = ("run", STREAM.replace("op: noted", "op: talking"), "--backend", "numpy")
    assert "a figure" in about(*words).out
    assert about(*words, "--quiet").out == ""
