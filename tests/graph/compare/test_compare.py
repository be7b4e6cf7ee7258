"""A comparison of variants: every run is made, stored, and reported."""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tactograph.graph.compare import compare
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.graph.conftest import Command, Outcome, Write, one_line

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
# The toy source reads no capture, so a variant has to state it: params that no node takes are gone.
EXTENDED = "format: 1\nextends: first.yaml\nparams: {capture: {kind: text}}\n"
VARIANT = EXTENDED + "patch: [{set: frames, with: {count: 2}}]"
FAILING = EXTENDED + "patch: [{replace: more, op: failing, in: {image: light}}]"


@dataclass
class Compared:
    """Compare the first graph, or others, on the first capture, or on others."""

    tactograph: Command
    graphs: list[str]
    captures: list[Path]
    out: Path

    def __call__(
        self,
        *more: object,
        graphs: Sequence[str] | None = None,
        over: Sequence[object] | None = None,
        out: Path | None = None,
    ) -> Outcome:
        captures = self.captures[:1] if over is None else over
        folders = [word for folder in captures for word in ("--over", folder)]
        words = [*(graphs or self.graphs[:1]), *folders, "--out", out or self.out, *more]
        return self.tactograph("compare", *words)

    def table(self) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = json.loads((self.out / "table.json").read_text())
        return rows


@pytest.fixture
def compared(toys: list[str], tactograph: Command, write: Write, tmp_path: Path) -> Compared:
    graphs = {"first.yaml": GRAPH, "second.yaml": VARIANT, "third.yaml": FAILING}
    captures = [tmp_path / "captures" / name for name in ("a", "b")]
    for folder in captures:
        folder.mkdir(parents=True)
    files = [write(text, name) for name, text in graphs.items()]
    return Compared(tactograph, files, captures, tmp_path / "report")


def test_every_variant_runs_on_every_capture_on_every_back_end(compared: Compared) -> None:
    done = compared(
        "--backends", "numpy,opencl", graphs=compared.graphs[:2], over=compared.captures
    )
    assert done.code == 0, done.err
    rows = compared.table()
    assert len(rows) == 8
    assert {(row["variant"], row["capture"], row["backend"]) for row in rows} == {
        (v, c, b) for v in ("first", "second") for c in "ab" for b in ("numpy", "opencl")
    }
    assert rows[0]["figures"] == {"mean": 2.0, "truth": 1.0}
    assert {"light", "more"} <= set(rows[0]["milliseconds"])
    assert rows[1]["backends"]["light"] == "opencl"
    with (compared.out / "table.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["mean"]) for line in lines] == [row["figures"]["mean"] for row in rows]


def test_a_folder_of_captures_gives_a_row_for_each_and_their_mean(compared: Compared) -> None:
    (compared.captures[0].parent / "c").mkdir()
    done = compared(over=[compared.captures[0].parent])
    assert done.code == 0, done.err
    assert [row["capture"] for row in compared.table()] == ["a", "b", "c"]
    assert "mean of 3 captures" in done.out


def test_escape_codes_are_not_printed_as_text(
    compared: Compared, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With this, rich takes any output for a terminal.
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    done = compared()
    assert "variant" in done.out
    assert "\\x1b" not in done.out


def test_a_finished_run_is_not_repeated(compared: Compared, toys: list[str]) -> None:
    assert compared().code == 0
    first = compared.table()
    toys.clear()
    assert compared().code == 0
    assert toys == []
    assert compared.table() == first


@pytest.mark.one_case
@pytest.mark.parametrize("what", ["value", "graph", "back end", "damaged", "device"])
def test_a_run_is_repeated_after_a_change(
    compared: Compared, toys: list[str], write: Write, what: str
) -> None:
    words: list[str] = []
    assert compared().code == 0
    toys.clear()
    if what == "value":
        words.append("level=2")
    elif what == "graph":
        write(GRAPH.replace("count: 1", "count: 3"), "first.yaml")
    elif what == "back end":
        words += ["--backends", "opencl"]
    elif what == "device":
        words += ["--device", "e"]
    else:
        (row,) = compared.out.rglob("row.json")
        row.write_text('{"half')
    assert compared(*words).code == 0
    assert "touch 1" in toys


@pytest.mark.parametrize("failure", ["a node", "the input", "the engine"])
def test_a_run_that_fails_does_not_stop_the_others(
    compared: Compared, write: Write,
    monkeypatch: pytest.MonkeyPatch, failure: str,
) -> None:  # fmt: skip
    if failure == "the input":
        write(FAILING.replace("failing", "refusing"), "third.yaml")
    if failure == "the engine":
        ordinary = open_pipeline

        def broken(graph: Any, *args: Any, **keywords: Any) -> Any:
            if graph.name == "third":
                raise RuntimeError("a careless node")
            return ordinary(graph, *args, **keywords)

        monkeypatch.setattr(compare, "open_pipeline", broken)
    done = compared(graphs=[compared.graphs[2], compared.graphs[0]])
    assert done.code == 1, done.err
    assert "failed: third on a: " in done.out
    assert ("too dark" if failure == "the input" else "a careless node") in done.out
    assert "failed: " in (compared.out / "report.html").read_text()
    rows = compared.table()
    assert [bool(row["error"]) for row in rows] == [True, False]
    assert not (compared.out / "third" / "preferred" / "a" / "row.json").exists()


def test_if_every_run_fails_the_command_fails(compared: Compared) -> None:
    done = compared(graphs=compared.graphs[2:])
    assert done.code == 2
    assert done.err.endswith("tactograph: every run failed; the reasons are above\n")


def test_a_figure_that_is_not_there_costs_no_report(compared: Compared) -> None:
    done = compared("--columns", "nope")
    assert (done.code, "there is no figure 'nope'" in done.err) == (2, True)
    assert (compared.out / "report.html").exists()


def test_a_fallback_is_reported_once(compared: Compared, write: Write, no_device: None) -> None:
    text = GRAPH.replace("prefer: [numpy]\n", "")
    graphs = [write(text, name) for name in ("first.yaml", "second.yaml")]
    done = compared(graphs=graphs, over=compared.captures)
    line = "light runs on numpy: opencl is preferred, but no OpenCL device works"
    assert done.out.count("fallback: ") == 1
    assert f"fallback: first, second: {line}" in done.out
    assert [row["fallbacks"] for row in compared.table()] == 4 * [[line]]
    assert (compared.out / "report.html").read_text().count(f"Fallback: first, second: {line}") == 1


def test_warnings_are_counted_and_marked(compared: Compared, tmp_path: Path, write: Write) -> None:
    text = GRAPH.replace("op: doubled", 'op: noticed, with: {text: "<LEDs> swapped"}')
    graphs = [write(GRAPH, "first.yaml"), write(text, "second.yaml")]
    (tmp_path / "captures" / "capture.yaml").write_text("of: all")
    done = compared(graphs=graphs, over=[tmp_path / "captures"])
    assert "\n2 of 4 with warnings\n" in done.out
    assert done.out.count("warning: ") == 1
    assert "\nwarning: second on a and 1 more: <LEDs> swapped\n" in done.out
    with (compared.out / "table.csv").open() as lines:
        warnings = {(row["variant"], row["warnings"]) for row in csv.DictReader(lines)}
    assert warnings == {("first", ""), ("second", "<LEDs> swapped")}
    page = (compared.out / "report.html").read_text()
    assert "second on a and 1 more: &lt;LEDs&gt; swapped" in page
    assert page.count('title="&lt;LEDs&gt; swapped"') == 3, "two captures and their mean"


def test_the_table_keeps_a_warning_of_an_early_item(compared: Compared, write: Write) -> None:
    text = GRAPH.replace("count: 1", "count: 3").replace(
        "op: doubled, in: {image: light}", "op: warns_once, in: {image: frames.image}"
    )
    compared(graphs=[write(text, "first.yaml")])
    assert compared.table()[0]["warnings"] == ["two"]


def test_many_fallbacks_of_a_graph_are_reported_in_one_line(
    compared: Compared, write: Write, no_device: None
) -> None:
    text = GRAPH.replace("prefer: [numpy]\n", "").replace("in: {image: more", "in: {image: l8")
    lights = "".join(
        f"  l{at}: {{op: flat_field, in: {{image: {before}, flat: cal.flat, dark: cal.dark}}}}\n"
        for at, before in enumerate(["more", *(f"l{at}" for at in range(8))])
    )
    graph = write(text.replace("  score:", f"{lights}  score:"), "many.yaml")
    done = compared(graphs=[graph])
    reason = "numpy: opencl is preferred, but no OpenCL device works"
    assert f"fallback: many: every node runs on {reason}" in done.out
    assert compared.table()[0]["fallbacks"] == [f"every node runs on {reason}"]


def test_two_captures_of_one_name_are_refused(compared: Compared, tmp_path: Path) -> None:
    more = tmp_path / "more" / "a"
    more.mkdir(parents=True)
    message = one_line(compared(over=[compared.captures[0], more]))
    assert "two runs are called first/preferred/a" in message


def test_a_capture_is_named_by_its_folder_however_it_is_reached(
    compared: Compared, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(compared.captures[0])
    done = compared(over=["."])
    assert done.code == 0, done.err
    assert (compared.out / "first" / "preferred" / "a" / "row.json").is_file()


def test_a_name_in_brackets_is_printed_as_it_is(compared: Compared, tmp_path: Path) -> None:
    folder = tmp_path / "[red] [bold]"
    folder.mkdir()
    done = compared(over=[folder])
    assert done.code == 0, done.err
    assert "[red] [bold]" in done.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--over", "nowhere"), "'nowhere' does not exist"),
        (("--over", ".", "--backends", "cuda"), "--backends cuda: there are numpy, opencl"),
        (("--over", ".", "--out", "."), "--out .: is what --over . reads; give another place"),
        (("--over", ".", "levle=1"), "no parameter 'levle'; did you mean 'level'?"),
    ],
)
def test_a_wrong_argument_is_reported_before_anything_runs(
    compared: Compared, toys: list[str], words: tuple[str, ...], message: str
) -> None:
    assert message in one_line(compared(*words, over=[]))
    assert toys == []
    assert not compared.out.exists()


def test_a_report_that_cannot_be_written_ends_in_one_line(
    compared: Compared, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("a file is in the way")
    done = compared(out=tmp_path / "file" / "report")
    assert done.code == 2
    assert "cannot be written" in done.err
    assert "Traceback" not in done.err
