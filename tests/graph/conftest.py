"""Graph files, toy nodes and a command line for the tests of the engine."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.programs import POCL_PLATFORM, build
from tactograph.graph.command import main
from tactograph.graph.declare import find_node as find
from tactograph.graph.disk import disk_cache
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.rings import Ring
from tests.graph.toys import CALLS, TOYS

SLOPES = """
format: 1
title: Height to slopes and back
params:
  file: {kind: path, help: a height map}
nodes:
  height: {op: read_height, with: {file: $file}}
  pixel:  {op: pixel_size, with: {mm: 0.1}}
  slope:  {op: height_slopes, in: {height: height, pixel: pixel}}
  again:  {op: integrate_dct, in: {slope: slope.slope, pixel: pixel}}
outputs: {height: again, mask: slope.mask}
"""
STREAM = """
format: 1
title: A stream of touches
params:
  count: {kind: integer, default: 3}
prefer: [opencl, numpy]
nodes:
  frames: {op: touches, with: {count: $count}}
  cal:    {op: at_rest}
  light:  {op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark}}
  score:  {op: watched, in: {image: light, truth: frames.truth}}
  save:   {op: noted, in: {image: light}}
outputs: {light: light, score: score}
"""

WAITING = STREAM.replace(", default: 3}", "}")
"""The same graph, whose images the caller supplies."""

Write = Callable[..., str]


class Outcome(NamedTuple):
    """The exit code and the output of a command."""

    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


def one_line(done: Outcome, code: int = 2) -> str:
    """The line on stderr of a command that failed as it should."""
    assert done.code == code
    assert "Traceback" not in done.out + done.err
    assert done.err.count("\n") == 1
    assert done.err.startswith("tactograph: ")
    return done.err


def added(nodes: str, outputs: str, text: str = STREAM) -> str:
    """The stream with more nodes and their outputs."""
    return text.replace("  score:", f"{nodes}\n  score:").replace(
        "{light: light,", f"{{light: light, {outputs},"
    )


def lit_by(op: str, text: str = STREAM) -> str:
    """The stream whose light comes from another node, which takes the images alone."""
    light = "op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark}"
    return text.replace(light, f"op: {op}, in: {{image: frames.image}}")


def graph_of(text: str) -> Graph:
    """The graph of a text, where no test needs a file."""
    return read_graph(Document.parse(text, "graph.yaml").data)


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a graph file and return its path."""

    def write_graph(text: str, name: str = "graph.yaml") -> str:
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        return str(file)

    return write_graph


@pytest.fixture
def no_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "tactograph.graph.backends.opencl.choose_device",
        lambda *_, **__: (None, "no OpenCL device works"),
    )


@pytest.fixture(params=["numpy", "opencl"])
def backend(request: pytest.FixtureRequest) -> str:
    """Each back end in turn."""
    return str(request.param)


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Register the toy nodes, as if a package provided them; return the list of their calls."""
    ring = Ring("toys", "tests.graph", "toys", {})
    places = {name: [find.NodePlace("tests.graph.toys", "", ring)] for name in TOYS}
    known = find._all_places
    monkeypatch.setattr(find, "_all_places", lambda path: {**known(path), **places})
    CALLS.clear()
    return CALLS


@pytest.fixture
def height_file(tmp_path: Path) -> str:
    """A smooth bump, 24 x 32, in mm."""
    y, x = np.mgrid[-1:1:24j, -1:1:32j]
    file = tmp_path / "height.npy"
    np.save(file, np.exp(-4 * (x * x + y * y)).astype(np.float32))
    return str(file)


@pytest.fixture
def tactograph(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line: call it with words, get the exit code and what it printed."""

    def run(*words: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["tactograph", *map(str, words)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        return Outcome(int(end.value.code or 0), *capsys.readouterr())

    return run


@pytest.fixture
def about(tactograph: Command, write: Write, toys: list[str]) -> Command:
    """Run a command with the text of a graph, which may have toy nodes, and further words."""
    return lambda name, text, *words: tactograph(name, write(text), *words)


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for programs, and no memory of earlier ones."""
    chosen, _ = choose_device()
    if chosen.handle.platform.name != POCL_PLATFORM:
        pytest.skip("programs of this driver are not cached")
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.delenv("PYOPENCL_NO_CACHE")
    build.cache_clear()
    return tmp_path / "cache"
