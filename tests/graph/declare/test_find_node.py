"""Nodes are found by name: the built-in ones, and those of other packages."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import GraphError, InputError, NodeError, load
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import find_node, node_names, shipped_nodes
from tactograph.graph.files.read_graph import read_graph
from tests.fixtures import python
from tests.graph.conftest import Command, Write

NODE = '''
"""A node of another package."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node

Light = Annotated[NDArray[np.float32], Port("K H W", "1")]


@node(neutral="light")
def {name}(light: Light, *, by: float = 3.0) -> Light:
    """Multiply the light."""
    return light * np.float32(by)


{name}.opencl(grid="K H W")
'''
KERNEL = """
#include "common.clh"

__kernel void {name}(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W,
    const float by)
{{
    const int x = get_global_id(0), y = get_global_id(1), k = get_global_id(2);
    if (x >= W || y >= H || k >= K) return;
    const int i = (k * H + y) * W + x;
    out[i] = light[i] * by;
}}
"""
STREAM = """
format: 1
params: {{folder: {{kind: path}}}}
nodes:
  frames: {{op: read_capture, with: {{folder: $folder}}}}
  more:   {{op: {name}, in: {{light: frames.image}}, with: {{by: 4}}}}
outputs: {{light: more}}
"""

Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a package with a node into a folder as pip does, and put the folder on the path."""
    site = tmp_path / "site"
    before = set(sys.modules)

    def lay(package: str, name: str, node: str = NODE, kernel: str | None = KERNEL) -> Path:
        module = package.replace("-", "_")
        folder = site / module
        folder.mkdir(parents=True)
        for part in ("", "nodes", "kernels"):
            (folder / part).mkdir(exist_ok=True)
            (folder / part / "__init__.py").touch()
        (folder / "nodes" / f"{name}.py").write_text(node.format(name=name))
        if kernel is not None:
            (folder / "kernels" / f"{name}.cl").write_text(kernel.format(name=name))
        info = site / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[tactograph.rings]\n{module} = {module}\n")
        monkeypatch.syspath_prepend(str(site))
        return folder

    yield lay
    for module in set(sys.modules) - before:
        if module.startswith(("acme", "other")):
            del sys.modules[module]


def test_every_node_file_is_a_node_of_that_name() -> None:
    assert "flat_field" in shipped_nodes()
    assert not [name for name in shipped_nodes() if name.startswith("_")]


@pytest.mark.parametrize("name", ["_fourier", "__init__", "os", "os.path", "", "read_capture.x"])
def test_a_name_of_no_node_is_refused(name: str) -> None:
    with pytest.raises(GraphError, match="no node is called"):
        find_node(name)


def test_a_node_of_another_package_is_found_by_its_name(install: Install) -> None:
    install("acme-optics", "acme_scale")
    assert "acme_scale" in node_names()
    node = find_node("acme_scale")
    assert node.package == "acme-optics"
    assert node.kernel_package == "acme_optics.kernels"


@pytest.mark.filterwarnings("ignore:.*saturated")
def test_a_node_of_another_package_runs_on_both_back_ends(
    install: Install, write: Write, device: OpenCL, backend: str
) -> None:
    install("acme-optics", "acme_scale")
    pipeline = load(write(STREAM.format(name="acme_scale")), backend=backend)
    stack = np.linspace(0, 1, 3 * 7 * 11, dtype=np.float32).reshape(3, 7, 11)
    result = pipeline(frames=stack)
    np.testing.assert_array_equal(result["light"], stack * np.float32(4))
    assert pipeline.plan.placements["more"].backend == backend


def test_a_node_of_another_package_is_loaded_only_when_a_graph_names_it(
    install: Install, write: Write, tmp_path: Path
) -> None:
    install("acme-optics", "acme_scale")
    (tmp_path / "cal.npz").touch()
    node_names()
    find_node("flat_field")
    read_graph("paper")
    load("reconstruct", calibration=str(tmp_path / "cal.npz"), backend="numpy")
    assert "acme_optics" not in sys.modules
    load(write(STREAM.format(name="acme_scale")), backend="numpy")
    assert "acme_optics.nodes.acme_scale" in sys.modules


@pytest.mark.parametrize(
    ("code", "reason"),
    [("raise RuntimeError('no licence')", "no licence"), ("raise SystemExit", "SystemExit")],
)
def test_a_package_that_cannot_be_loaded_harms_only_the_graph_that_names_it(
    install: Install, write: Write, tactograph: Command, code: str, reason: str
) -> None:
    install("acme-optics", "acme_scale", node=f"{code}\n\n\n@node\ndef {{name}}(): pass\n")
    assert tactograph("check", "paper").code == 0
    done = tactograph("check", write(STREAM.format(name="acme_scale")))
    assert done.code == 1
    assert f"'acme_scale' of package acme-optics cannot be loaded: {reason}" in done.err
    listed = tactograph("nodes")
    assert listed.code == 0
    assert reason in listed.out
    assert "flat_field" in listed.out


def test_a_name_of_two_packages_is_an_error_that_names_both(install: Install, write: Write) -> None:
    install("acme-optics", "acme_scale")
    install("other-optics", "acme_scale")
    with pytest.raises(InputError, match="in acme-optics and other-optics; uninstall one"):
        find_node("acme_scale")
    with pytest.raises(GraphError, match=r"graph.yaml:6:12: nodes.more.op: two nodes are called"):
        load(write(STREAM.format(name="acme_scale")))


def test_a_shipped_node_takes_precedence_over_a_plug_in_of_its_name(install: Install) -> None:
    install("acme-optics", "flat_field")
    with pytest.warns(UserWarning, match="'flat_field' of acme-optics is not used"):
        assert find_node("flat_field").package == "tactograph"


def test_a_file_that_holds_a_node_of_another_name_is_refused(install: Install) -> None:
    install(
        "acme-optics",
        "acme_scale",
        node=NODE.replace("def {name}", "def other").replace("{name}.opencl", "other.opencl"),
    )
    with pytest.raises(NodeError, match="defines no @node function of that name"):
        find_node("acme_scale")


@pytest.mark.parametrize(
    ("kernel", "message"),
    [
        (KERNEL.replace("float by", "int by"), "argument 6 is 'int by', but the declaration says"),
        (None, "there is no acme_scale.cl in acme_optics.kernels"),
    ],
)
def test_a_kernel_that_does_not_match_or_is_missing_is_refused_before_the_run(
    install: Install, write: Write, device: OpenCL, kernel: str | None, message: str
) -> None:
    install("acme-optics", "acme_scale", kernel=kernel)
    with pytest.raises(NodeError, match=message):
        load(write(STREAM.format(name="acme_scale")), backend="opencl")


def test_the_command_line_finds_the_node_of_an_installed_package(
    install: Install, tmp_path: Path
) -> None:
    folder = install("acme-optics", "acme_scale")
    command = ("-m", "tactograph.graph.command", "nodes", "acme_scale")
    done = python(*command, cwd=tmp_path, PYTHONPATH=folder.parent, PATH="")
    assert done.stdout.startswith("# acme_scale\n\nMultiply the light.")
    assert "Package acme-optics" in done.stdout
