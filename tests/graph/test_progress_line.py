"""The present stage is shown on a terminal, and in a pipe at intervals."""

import io
import sys
import threading

import pytest

from tactograph.graph.commands import progress_line
from tactograph.graph.commands.progress_line import ProgressLine
from tactograph.graph.files import read_graph
from tests.graph.conftest import STREAM, Command


class Terminal(io.StringIO):
    """Records what is written and signals when a word comes, after another one if one is named."""

    def __init__(self, word: str, after: str = "") -> None:
        super().__init__()
        self._word, self._after = word, after
        self.came = threading.Event()

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        written = super().write(text)
        start = self.getvalue().find(self._after)
        if start >= 0 and self._word in self.getvalue()[start:]:
            self.came.set()
        return written


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_line, "MIN_SHOWN_S", 0.0)
    monkeypatch.setattr(progress_line, "REDRAW_INTERVAL_S", 0.001)


def test_a_run_shows_its_stage_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal(" 0 s", after="model (fit_film)")
    monkeypatch.setattr(sys, "stderr", terminal)
    with ProgressLine() as line:
        line.stage_of = lambda: "model (fit_film)"
        assert terminal.came.wait(60)
    assert "s left" not in terminal.getvalue()


def test_the_remaining_time_follows_from_the_share_of_captures_that_is_done() -> None:
    line = ProgressLine(wanted=False)
    line.at("1 of 4 captures", 1 / 4)
    assert line.remaining_s(5.0) == pytest.approx(15)


@pytest.mark.parametrize("quiet", [False, True])
def test_run_shows_its_stage_on_a_terminal_unless_it_is_quiet(
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


def test_a_pipe_gets_a_line_at_intervals(
    about: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert about("run", STREAM, "--backend", "numpy").err == ""
    monkeypatch.setattr(progress_line, "PRINT_INTERVAL_S", 0.01)
    printed = ""
    with ProgressLine() as line:
        line.stage_of = lambda: "model (fit_film)"
        while printed.count("model (fit_film): 0 s\n") < 2:
            printed += capsys.readouterr().err


def test_quiet_suppresses_what_nodes_print(about: Command) -> None:
    words = ("run", STREAM.replace("op: noted", "op: talking"), "--backend", "numpy")
    assert "a figure" in about(*words).out
    assert about(*words, "--quiet").out == ""
