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


def test_a_trace_has_a_lane_for_host_device_and_transfers(
    tactograph: Command, write: Write, height_file: str, tmp_path: Path
) -> None:
    file = tmp_path / "trace.json"
    done = tactograph("run", write(SLOPES), f"file={height_file}", "--trace", file)
    assert done.code == 0, done.err
    events = json.loads(file.read_text())["traceEvents"]
    lanes = {e["tid"]: e["args"]["name"] for e in events if e["ph"] == "M"}
    where = {e["name"]: lanes[e["tid"]] for e in events if e["ph"] == "X"}
    assert where["height"] == "host, MainThread"
    assert where["slope"] == "device"
    assert where["upload height.read_height"] == "transfers"
    spans = {e["name"]: e for e in events if e["ph"] == "X"}
    assert all(e["ts"] >= 0 and e["dur"] >= 0 for e in spans.values())
    # The clocks agree: an upload begins after its array was read, and ends before it is used.
    upload = spans["upload height.read_height"]
    slack = 2000
    assert upload["ts"] >= spans["height"]["ts"] + spans["height"]["dur"] - slack
    assert upload["ts"] + upload["dur"] <= spans["slope"]["ts"] + 1


def test_a_trace_that_cannot_be_written_is_told(
    tactograph: Command, write: Write, height_file: str, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    words = ("run", write(SLOPES), f"file={height_file}", "--trace", tmp_path / "file" / "t.json")
    done = tactograph(*words)
    assert (done.code, "cannot be written" in done.err) == (2, True)


def test_values_from_inside_are_kept_beside_the_result(
    tactograph: Command, write: Write, height_file: str, tmp_path: Path, backend: str
) -> None:
    words = ("run", write(WITH_OUT), f"file={height_file}", f"out={tmp_path / 'out'}")
    done = tactograph(*words, "--keep", "slope.slope,pixel", "--backend", backend)
    assert done.code == 0, done.err
    kept = tmp_path / "out" / "kept" / "1"
    assert np.load(kept / "slope.slope.npy").shape == (2, *np.load(height_file).shape)
    assert (kept / "slope.slope.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((kept / "pixel.json").read_text()) == pytest.approx(0.1)


def test_until_runs_what_a_node_needs_and_writes_nothing(
    toys: list[str], tactograph: Command, write: Write
) -> None:
    done = tactograph("run", write(STREAM), "count=1", "--until", "light", "--backend", "numpy")
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


def test_what_is_inside_a_use_of_a_group_is_kept_too(
    toys: list[str], tactograph: Command, write: Write, tmp_path: Path
) -> None:
    words = ("run", write(GROUPED), f"out={tmp_path}")
    done = tactograph(*words, "--keep", "use.one,use.light,use.two.doubled")
    assert done.code == 0, done.err
    kept = tmp_path / "kept" / "1"
    means = {file.stem: np.load(file).mean() for file in kept.glob("*.npy")}
    assert means == {"use.one": 2, "use.light": 4, "use.two.doubled": 4}
    toys.clear()
    done = tactograph(*words, "--until", "use", "--trace", tmp_path / "trace.json")
    assert (done.code, toys) == (0, ["touch 1", "doubled", "doubled"])
    assert '"use.one"' in (tmp_path / "trace.json").read_text()
    done = tactograph(*words, "--keep", "use.tow")
    assert (done.code, "the group 'more' has no output or node 'tow'" in done.err) == (2, True)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--keep", "ligth"), "there is no node 'ligth'; did you mean 'light'"),
        (("--keep", "light.high"), "node 'light' makes no 'high'"),
        (("--keep", ","), "--keep ,: write it as node.port,node"),
        (("--until", "lihgt"), "there is no node 'lihgt'; did you mean 'light'"),
        (("--until", "save"), "--until save: it only writes"),
    ],
)
def test_what_is_not_there_cannot_be_kept(
    toys: list[str], tactograph: Command, write: Write, option: tuple[str, str], message: str
) -> None:
    assert message in one_line(tactograph("run", write(STREAM), *option))
    assert toys == []


def test_looking_makes_no_other_graph_of_it(
    toys: list[str], tactograph: Command, write: Write, tmp_path: Path
) -> None:
    file = write(STREAM)
    tactograph("run", file, "count=1", "--trace", tmp_path / "a.json", "--backend", "numpy")
    os.chdir(tmp_path)
    words = ("run", file, "count=1", "--trace", tmp_path / "b.json", "--keep", "cal.flat")
    assert tactograph(*words, "--backend", "numpy").code == 0
    one, two = (json.loads((tmp_path / f"{n}.json").read_text())["otherData"] for n in "ab")
    assert one == two


def test_watch_runs_again_when_the_graph_changes_and_tells_its_mistakes(
    write: Write, height_file: str, tmp_path: Path
) -> None:
    file = Path(write(WITH_OUT))
    words = ["run", str(file), f"file={height_file}", "--watch", "--backend", "numpy"]
    watcher = subprocess.Popen(
        [sys.executable, "-u", "-m", "tactograph.graph.command", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
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
