"""A stored result replaces a new one only if everything it depends on is the same."""

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

from tactograph.graph.cache import result_origin
from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.declare import find_node as find
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.rings import Ring
from tests.graph.conftest import Command, Write

GRAPH = """
format: 1
params: {capture: {kind: path, default: null}, out: {kind: path, default: out}}
prefer: [numpy]
nodes:
  made: {op: halved, with: {text: made.txt}}
outputs: {made: made}
"""
FILES = {
    "felt/__init__.py": "",
    "felt/halved.py": """
        from pathlib import Path
from typing import Any
        import numpy as np
        import felt_beside
        from tactograph.graph import node
        from tactograph.nodes import Height
        from felt import _helper
        from ._levels import LEVEL

        @node
        def halved(*, text: Path = Path("made.txt"), level: float = 1.0) -> Height:
            return np.full((2, 2), _helper.half(LEVEL), np.float32)

        halved.opencl(grid="H W")
        """,
    "felt/_helper.py": "from felt._deeper import TWO\n\ndef half(x): return x / TWO\n",
    "felt/_deeper.py": "TWO = 2\n",
    "felt/_levels.py": "LEVEL = 3\n",
    "felt/table.txt": "1 2 3\n",
    "felt/inside/__init__.py": "",
    "felt/inside/table.txt": "1 2 3\n",
    "felt/halved.cl": '#include "half.clh"\n__kernel void halved(__global float *out, const int H,'
    " const int W, const float level) { out[get_global_id(0)] = level; }\n",
    "felt/half.clh": "#define HALF 0.5f\n",
    "felt_beside.py": "",
}


@pytest.fixture
def plug_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An outside package with one node and all files that the node depends on."""
    root = tmp_path / "plug_in"
    for name, text in FILES.items():
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(line.removeprefix(" " * 8) for line in text.split("\n")))
    monkeypatch.syspath_prepend(root)
    ring = Ring("felt", "felt", "felt", {})
    places = {"halved": [find.NodePlace("felt.halved", "", ring)]}
    known = find._all_places
    monkeypatch.setattr(find, "_all_places", lambda path: {**known(path), **places})
    monkeypatch.chdir(tmp_path)
    Path("made.txt").write_text("made")
    # A process takes imported files as unchanging; here they are written anew.
    monkeypatch.setattr(result_origin, "_source", result_origin._source.__wrapped__)
    for name in [name for name in sys.modules if name.partition(".")[0].startswith("felt")]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return root


def origin_of(graph: str) -> dict[str, Any]:
    return find_origin(read_graph(graph), {})


@pytest.mark.parametrize("name", FILES)
def test_the_origin_changes_with_every_file_of_a_node(
    plug_in: Path, write: Write, name: str
) -> None:
    graph = write(GRAPH)
    before = origin_of(graph)
    with (plug_in / name).open("a") as file:
        file.write("\n")
    assert origin_of(graph)["code"]["felt"] != before["code"]["felt"]
    assert origin_of(graph)["code"]["engine"] == before["code"]["engine"]


@pytest.mark.parametrize("folder", ["felt/tests", "felt/recordings"])
def test_the_origin_does_not_change_with_tests_and_recordings(
    plug_in: Path, write: Write, folder: str
) -> None:
    graph = write(GRAPH)
    before = origin_of(graph)
    (plug_in / folder).mkdir()
    (plug_in / folder / "data.npy").write_bytes(b"0")
    assert origin_of(graph) == before


def test_the_origin_names_a_device_only_where_one_is_used(plug_in: Path, write: Write) -> None:
    assert origin_of(write(GRAPH))["device"] == ""
    assert "driver" in origin_of(write(GRAPH.replace("[numpy]", "[opencl]")))["device"]


def count_runs(tactograph: Command, *words: object) -> int:
    done = tactograph("compare", *words)
    assert done.code == 0, done.err
    return 0 if "1 of 1 runs were there already" in done.err else 1


@pytest.mark.one_case
@pytest.mark.parametrize("what", ["helper", "kernel", "version", "file of the graph", "nothing"])
def test_a_comparison_is_repeated_after_any_change(
    plug_in: Path, write: Write, tactograph: Command, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    words = write(GRAPH.replace("capture: {kind: path, default: null}, ", "")), "--out", "report"
    assert count_runs(tactograph, *words) == 1
    if what == "helper":
        (plug_in / "felt/_helper.py").write_text("def half(x): return x / 4")
    elif what == "kernel":
        (plug_in / "felt/halved.cl").write_text(FILES["felt/halved.cl"].replace("level;", "1;"))
    elif what == "version":
        monkeypatch.setattr(result_origin, "versions", lambda: {"scipy": "99"})
    elif what == "file of the graph":
        Path("made.txt").write_text("another")
    assert count_runs(tactograph, *words) == (what != "nothing")
