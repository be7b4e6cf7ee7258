"""Kinds of layers are found in the core and in other packages."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import GraphError, InputError, NodeError, load
from tactograph.graph.command import run_command
from tactograph.nodes import F4
from tactograph.nodes.stream.touch import LayerKind, LayerKinds
from tests.nodes.touches import touch_of

SIZE = (24, 32)
WARMTH = """
from typing import Annotated
from tactograph.nodes import Height
from tactograph.nodes.stream.touch import ColourMap, LayerKind

KIND = LayerKind(Annotated[Height, "how warm"], ColourMap("warmth"), topics={"warm": None})
"""
GRAPH = """
format: 1
params:
  capture: {kind: path}
  file: {kind: path}
  out: {kind: path, default: out}
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  height: {op: read_height, with: {file: $file}}
  pixel:  {op: pixel_size, with: {mm: 0.1}}
  touch:
    op: join_touch
    in: {height: height, pixel: pixel, frames: frames, warmth: height}
  save:
    op: write_result
    in: {touch: touch}
    with: {folder: $out}
outputs: {warmth: height}
"""

Lay = Callable[[str, str], None]


@pytest.fixture
def ring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lay]:
    """Install a package with a layer on the path, as pip does."""

    def lay(name: str, text: str) -> None:
        site = tmp_path / "site"
        for file, content in {
            "acme_warm/__init__.py": "",
            f"acme_warm/layers/{name}.py": text,
            "acme_warm-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: acme-warm\n",
            "acme_warm-1.0.dist-info/entry_points.txt": "[tactograph.rings]\nwarm = acme_warm\n",
        }.items():
            (site / file).parent.mkdir(parents=True, exist_ok=True)
            (site / file).write_text(content)
        monkeypatch.syspath_prepend(str(site))

    yield lay
    for module in [name for name in sys.modules if name.startswith("acme_warm")]:
        del sys.modules[module]


def test_every_kind_of_this_project_loads() -> None:
    kinds = LayerKinds()
    assert {"shadow", "highlight", "contact", "confidence", "error", "unresolved"} <= {*kinds}
    assert all(isinstance(kinds[name], LayerKind) for name in kinds)


def test_a_kind_is_imported_on_request_and_without_matplotlib() -> None:
    code = (
        "import sys\n"
        "from tactograph.nodes.stream.touch import LayerKinds\n"
        "[*LayerKinds()], LayerKinds()['shadow'], LayerKinds()['error']\n"
        "print([m for m in sys.modules if '.layers.' in m or m == 'matplotlib'])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    package = "tactograph.nodes.layers"
    assert done.stdout.strip() == f"['{package}.shadow', '{package}.error']"


def write_inputs(folder: Path) -> tuple[F4, list[str]]:
    """A height and a capture in a folder, and the words that name the graph and the height."""
    height, capture = np.random.default_rng(1).random(SIZE, np.float32), folder / "capture"
    np.save(folder / "height.npy", height)
    capture.mkdir()
    for led in range(1, 5):
        cv2.imwrite(str(capture / f"led{led}.png"), np.full(SIZE, 40 * led, np.uint8))
    return height, [str(folder / "graph.yaml"), f"file={folder / 'height.npy'}"]


def test_a_layer_of_another_package_is_written_with_the_touch(ring: Lay, tmp_path: Path) -> None:
    ring("warmth", WARMTH)
    (tmp_path / "graph.yaml").write_text(GRAPH)
    height, words = write_inputs(tmp_path)
    capture = tmp_path / "capture"
    out = tmp_path / "out"
    run_command(["run", *words, f"capture={capture}", f"out={out}"])
    np.testing.assert_array_equal(np.load(out / "warmth.npy"), height)
    assert cv2.imread(str(out / "warmth.png")) is not None


@pytest.mark.parametrize(("name", "text"), [("gone", "import no_module"), ("odd", "KIND = 1")])
def test_a_layer_that_does_not_load_gives_one_line_where_a_graph_names_it(
    ring: Lay, tmp_path: Path, name: str, text: str
) -> None:
    ring(name, text)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace(", warmth:", f", {name}:"))
    with pytest.raises((GraphError, NodeError), match=rf"{name}.*warm") as caught:
        load(str(tmp_path / "graph.yaml"))
    assert "\n" not in str(caught.value)


def test_a_layer_without_a_kind_is_refused_with_the_known_ones() -> None:
    touch = touch_of(height=None, image=None, pixel=0.1, shade=1)
    with pytest.raises(InputError, match=r"no layer of a touch is called 'shade'; .*'shadow'"):
        touch.each_layer()
