"""Graphs as plain data and nodes of the user's program: the same checks, the same messages."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from annotated_types import Gt

from tactograph.graph import GraphError, InputError, NodeError, load, node, parity
from tactograph.graph.declare.node import Node
from tactograph.graph.files import graph_places
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.rings import Ring, rings
from tactograph.nodes import Light
from tests.fixtures import python
from tests.graph.conftest import STREAM, Write

KERNEL = """
#include "common.clh"
__kernel void brightened(
    __global const float *restrict light, __global float *restrict out,
    const int K, const int H, const int W, const float gain)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = light[i] * gain;
}
"""
STACK = np.full((3, 4, 5), 0.25, np.float32)


@node(neutral="light")
def brightened(light: Light, *, gain: Annotated[float, Gt(0)] = 2.0) -> Light:
    """More light."""
    return light * np.float32(gain)


brightened.opencl(grid="K H W", source=KERNEL)


def data(**changes: Any) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "format": 1,
        "params": {"capture": {"kind": "path"}},
        "nodes": {
            "frames": {"op": "read_capture", "with": {"folder": "$capture"}},
            "more": {"op": "brightened", "in": {"light": "frames.image"}, "with": {"gain": 3}},
        },
        "outputs": {"light": "more"},
    }
    return {**plain, **changes}


def test_a_graph_of_plain_data_runs_a_node_of_the_program(backend: str) -> None:
    pipeline = load(data(), nodes=[brightened], backend=backend)
    assert pipeline.plan.placements["more"].backend == backend
    np.testing.assert_allclose(pipeline(frames=STACK)["light"], 0.75)


class MuteError(Exception):
    """An error whose message cannot be read."""

    def __str__(self) -> str:
        raise ValueError


@pytest.mark.parametrize(
    "error", [SystemExit(0), BaseException("odd"), MuteError(), ValueError("odd")]
)
def test_a_node_is_named_whatever_it_raises(error: BaseException) -> None:
    @node
    def brightened(light: Light, *, gain: float = 2.0) -> Light:
        raise error

    pipeline = load(data(), nodes=[brightened], backend="numpy")
    with pytest.raises(NodeError, match=rf"'more' \(brightened\) failed: {type(error).__name__}: "):
        pipeline(frames=STACK)


class Named(NamedTuple):
    light: Light
    name: str


@pytest.mark.parametrize("value", [(STACK,), (STACK, "a", 1), {"light": STACK, "name": "a"}, None])
def test_a_node_that_does_not_return_its_record_is_named(value: Any) -> None:
    @node
    def brightened(light: Light, *, gain: float = 2.0) -> Named:
        result: Named = value
        return result

    graph = data(outputs={"light": "more.light", "name": "more.name"})
    message = r"'more' \(brightened\) failed: TypeError: Named\(light, name\) is declared, but a "
    with pytest.raises(NodeError, match=f"{message}{type(value).__name__}"):
        load(graph, nodes=[brightened], backend="numpy")(frames=STACK)


def brighter(source: object) -> Node:
    """The same node with another kernel."""

    @node
    def brightened(light: Light, *, gain: float = 2.0) -> Light:
        return light * np.float32(gain)

    brightened.opencl(grid="K H W", source=source)
    return brightened


def test_a_kernel_may_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "any.cl").write_text(KERNEL)
    assert parity.check(brighter(tmp_path / "any.cl")) > 5
    with pytest.raises(NodeError, match=r"the kernel .*none\.cl cannot be read"):
        parity.check(brighter(str(tmp_path / "none.cl")))


def test_parity_reports_the_cases_that_differ() -> None:
    with pytest.raises(AssertionError, match=r"'brightened' differs on .* cases:\n  K4xH1xW1"):
        parity.check(brighter(KERNEL.replace("* gain", "+ gain")))


def test_parity_needs_a_kernel() -> None:
    @node
    def plain(light: Light) -> Light:
        return light

    with pytest.raises(InputError, match="node 'plain' has no kernel"):
        parity.check(plain)


def test_a_graph_that_was_read_can_be_loaded(toys: list[str], write: Write) -> None:
    graph = read_graph(write(STREAM))
    results = list(load(graph, count=2, backend="numpy").items())
    assert len(results) == 2


def test_plain_data_may_extend_a_shipped_graph() -> None:
    patch = [{"neutral": "shadow"}]
    graph = read_graph({"format": 1, "extends": "paper", "patch": patch, "title": "No shadows"})
    assert graph.nodes["shadow"].neutral
    assert graph.hash == read_graph("paper_no_shadow").hash


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodess": {}}, r"test_without_files\.py:\d+: nodess: unknown key 'nodess'; did you mean"),
        ({"outputs": {"light": "moer"}}, r"outputs\.light: there is no node 'moer'; did you mean"),
        ({"title": object()}, r"test_without_files\.py:\d+: title: a object is not plain data"),
        ({"nodes": {1: {}}}, r"nodes: the key 1 is no text"),
        ({"prefer": ["metal"]}, r"prefer\[0\]: 'numpy' or 'opencl' is needed, not 'metal'"),
        ({"format": 2}, "this version reads format 1, not 2"),
    ],
)
def test_mistakes_in_plain_data_are_reported_by_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(GraphError, match=message):
        load(data(**changes), nodes=[brightened])


def test_a_node_of_the_program_needs_a_name_of_its_own() -> None:
    @node
    def flat_field(light: Light) -> Light:
        return light

    with pytest.raises(InputError, match="a shipped node is called 'flat_field'"):
        load(data(), nodes=[flat_field])
    with pytest.raises(InputError, match="two are called 'brightened'"):
        load(data(), nodes=[brightened, brightened])
    with pytest.raises(InputError, match="is not a node; decorate"):
        load(data(), nodes=[len])  # type: ignore[list-item]
    with pytest.raises(GraphError, match="no node is called 'brightened'"):
        load(data())


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((480, 640, 3), r"looks like H x W x K: np\.moveaxis\(stack, -1, 0\)"),
        ((480, 640, 4), r"looks like H x W x K: np\.moveaxis\(stack, -1, 0\)"),
        ((480, 640, 6), r"looks like H x W x K: np\.moveaxis\(stack, -1, 0\)"),
        ((4, 48, 64, 3), r"looks like K colour images: stack\[\.\.\., 1\]"),
        ((48, 64), r"not one image of \(48, 64\): np\.stack"),
    ],
)
def test_arrays_in_another_axis_order_are_refused_with_the_transpose(
    shape: tuple[int, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load(data(), nodes=[brightened], backend="numpy")(frames=np.zeros(shape, np.uint8))


def test_a_package_provides_pipelines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "felt" / "pipelines" / "felt"
    folder.mkdir(parents=True)
    (folder / "soft.yaml").write_text("format: 1\nextends: paper\npatch: [{neutral: shadow}]\n")
    (folder / "nap.yaml").write_text("format: 1\npatch: [{neutral: shadow}]\n")
    places = {"pipelines": ("felt.pipelines", tmp_path / "felt" / "pipelines")}
    felt = Ring("felt", "felt", "felt", places)
    monkeypatch.setattr(graph_places, "rings", lambda: (*rings(), felt))
    assert read_graph("felt/soft").nodes["shadow"].neutral
    variant = read_graph({"format": 1, "extends": "felt/soft", "title": "softer"})
    assert variant.hash == read_graph("felt/soft").hash
    assert with_overlays(read_graph("paper"), ["felt/nap"]).hash == variant.hash
    with pytest.raises(InputError, match="felt brings no pipeline 'sotf'; did you mean 'soft'"):
        read_graph("felt/sotf")


def test_pipelines_and_results_draw_themselves() -> None:
    pipeline = load(data(), nodes=[brightened], backend="numpy")
    result = pipeline(frames=STACK)
    assert "more" in pipeline._repr_svg_()
    assert " ms</text>" in pipeline._repr_svg_()
    assert "float32 3 x 4 x 5" in result._repr_html_()


def test_a_cell_is_named_as_the_notebook_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    shell = SimpleNamespace(compile=SimpleNamespace(format_code_name=lambda _: ("Cell", "In[7]")))
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    with pytest.raises(GraphError, match=r"^Cell In\[7\]:\d+: format"):
        load(data(format=3))


def test_importing_the_engine_loads_no_notebook_library() -> None:
    code = "import json, sys; import tactograph.graph; print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(python("-c", code).stdout)
    assert not {"IPython", "matplotlib", "pydantic"} & {*loaded}
