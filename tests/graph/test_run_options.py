"""`run --trace`, `--keep`, `--until` and `--watch`: what happened, looked at from outside."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.graph.conftest import SLOPES, STREAM, Command, Write, one_line

WITH_OUT = SLOPES.replace("a height map}\n", "a height map}\n  out: {kind: path, default: out}\n")


def test_a_trace_has_a_lane_for_host_device_and_transfers_or_is_told_if_it_cannot_be_written(
    about: Command, height_file: str, tmp_path: Path
) -> None:
    file = tmp_path / "trace.json"
    done = about("run", SLOPES, f"file={height_file}", "--trace", file)
    assert done.code == 0, done.err
    events = json.loads(file.read_text())["traceEvents"]
    lanes = {e["tid"]: e["args"]["name"] for e in events if e["ph"] == "M"}
    spans = {e["name"]: e for e in events if e["ph"] == "X"}
    where = {name: lanes[e["tid"]] for name, e in spans.items()}
    assert where["height"] == "host, MainThread"
    assert where["slope"] == "device"
    assert where["upload height.read_height"] == "transfers"
    assert all(e["ts"] >= 0 and e["dur"] >= 0 for e in spans.values())
    # The clocks agree: an upload begins after its array was read, and ends before it is used.
    upload = spans["upload height.read_height"]
    slack = 2000
    assert upload["ts"] >= spans["height"]["ts"] + spans["height"]["dur"] - slack
    assert upload["ts"] + upload["dur"] <= spans["slope"]["ts"] + 1
    done = about("run", SLOPES, f"file={height_file}", "--trace", file / "within.json")
    assert (done.code, "cannot be written" in done.err) == (2, True)


def test_values_from_inside_are_kept_beside_the_result(
    about: Command, height_file: str, tmp_path: Path, backend: str
) -> None:
    given = (f"file={height_file}", f"out={tmp_path / 'out'}")
    done = about("run", WITH_OUT, *given, "--keep", "slope.slope,pixel", "--backend", backend)
    assert done.code == 0, done.err
    kept = tmp_path / "out" / "kept" / "1"
    assert np.load(kept / "slope.slope.npy").shape == (2, *np.load(height_file).shape)
    assert (kept / "slope.slope.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((kept / "pixel.json").read_text()) == pytest.approx(0.1)


def test_an_output_is_kept_by_its_name(about: Command, height_file: str, tmp_path: Path) -> None:
    given = (f"file={height_file}", f"out={tmp_path / 'out'}")
    assert about("run", WITH_OUT, *given, "--keep", "mask", "--backend", "numpy").code == 0
    assert np.load(tmp_path / "out" / "kept" / "1" / "mask.npy").all()


def test_until_runs_what_a_node_needs_and_writes_nothing(toys: list[str], about: Command) -> None:
    done = about("run", STREAM, "count=1", "--until", "light", "--backend", "numpy")
    assert done.code == 0, done.err
    assert toys == ["at_rest", "touch 1"]


GROUPED = """
format: 1
params:
  count: {kind: integer, default: 1}
  out:   {kind: path}
prefer: [numpy]
groups:
  more:
    inputs:
      image: {}
    nodes:
      one: {op: doubled, in: {image: image}}
      two: {op: doubled, in: {image: one}}
    outputs: {light: two}
nodes:
  frames: {op: touches, with: {count: $count}}
  use:    {group: more, in: {image: frames.image}}
  again:  {group: more, in: {image: use.light}}
  save:   {op: noted, in: {image: again.light}}
"""


def test_the_inside_of_a_group_is_kept_too(toys: list[str], about: Command, tmp_path: Path) -> None:
    words = ("run", GROUPED, f"out={tmp_path}")
    done = about(*words, "--keep", "use.one,use.light,use.two.doubled")
    assert done.code == 0, done.err
    kept = tmp_path / "kept" / "1"
    means = {file.stem: np.load(file).mean() for file in kept.glob("*.npy")}
    assert means == {"use.one": 2, "use.light": 4, "use.two.doubled": 4}
    toys.clear()
    done = about(*words, "--until", "use", "--trace", tmp_path / "trace.json")
    assert (done.code, toys) == (0, ["touch 1", "doubled", "doubled"])
    assert '"use.one"' in (tmp_path / "trace.json").read_text()
    done = about(*words, "--keep", "use.tow")
    assert (done.code, "the group 'more' has no output or node 'tow'" in done.err) == (2, True)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--keep", "ligth"), "no node or output of that name; did you mean 'light'"),
        (("--keep", "light.high"), "node 'light' makes no 'high'"),
        (("--keep", ","), "--keep ,: write it as node.port,node"),
        (("--until", "lihgt"), "there is no node 'lihgt'; did you mean 'light'"),
        (("--until", "save"), "--until save: it only writes"),
    ],
)
def test_what_is_not_there_cannot_be_kept(
    toys: list[str], about: Command, option: tuple[str, str], message: str
) -> None:
    assert message in one_line(about("run", STREAM, *option))
    assert toys == []


def test_looking_makes_no_other_graph_of_it(about: Command, tmp_path: Path) -> None:
    words = ("run", STREAM, "count=1", "--backend", "numpy")
    about(*words, "--trace", tmp_path / "a.json")
    os.chdir(tmp_path)
    assert about(*words, "--trace", tmp_path / "b.json", "--keep", "cal.flat").code == 0
    one, two = (json.loads((tmp_path / f"{n}.json").read_text())["otherData"] for n in "ab")
    assert one == two


def test_watch_runs_again_when_the_graph_changes_and_tells_its_mistakes(
    write: Write, height_file: str, tmp_path: Path
) -> None:
    file = Path(write(WITH_OUT))
    words = ["run", str(file), f"file={height_file}", "--watch", "--backend", "numpy"]
    command = [sys.executable, "-u", "-m", "tactograph.graph.command", *words]
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    watcher = subprocess.Popen(command, **pipes, cwd=tmp_path)
    assert watcher.stderr is not None
    try:
        assert "watching" in watcher.stderr.readline()
        file.write_text(WITH_OUT.replace("slope: slope.slope", "slope: slop.slope"))
        assert "there is no node 'slop'; did you mean 'slope'" in watcher.stderr.readline()
        assert "watching" in watcher.stderr.readline()
        file.write_text(WITH_OUT)
        assert "watching" in watcher.stderr.readline()
        time.sleep(0.1)
        watcher.send_signal(signal.SIGINT)
        assert watcher.wait(timeout=20) == 0
        assert "stopped" in watcher.stderr.read()
    finally:
        watcher.kill()
        watcher.wait()
        watcher.stderr.close()
