"""Kernel sources: where a compiler's message points, headers of headers, attributes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import NodeError, node
from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.node import Node
from tactograph.nodes import Light

KERNEL = """#include "outer.clh"
// a comment
__kernel __attribute__((vec_type_hint(float))) void twice(
    __global const float *restrict light,
    __global float *restrict out,
    const int K, const int H, const int W)
{
    GRID_3(k, y, x, K, H, W)
    const int i = (k * H + y) * W + x;
    out[i] = TWO * light[i];
}
"""
OUTER = '#include "common.clh"\n#include "inner.clh"\n#include "inner.clh"  // once is enough\n'
INNER = "enum { TWO = 2 };\n"


@pytest.fixture
def twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Node:
    """A node whose kernel includes a header that includes others."""

    @node
    def twice(light: Light) -> Light:
        return light * np.float32(2)

    folder = tmp_path / "acme_twice"
    folder.mkdir()
    (folder / "__init__.py").touch()
    for name, text in {"twice.cl": KERNEL, "outer.clh": OUTER, "inner.clh": INNER}.items():
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "acme_twice", raising=False)
    twice.opencl(grid="K H W")
    twice.kernel_package = "acme_twice"
    return twice


def test_headers_include_headers_each_once(device: OpenCL, twice: Node) -> None:
    light = np.arange(12, dtype=np.float32).reshape(1, 3, 4)
    prepared = device.prepare(twice, {}, {"K": 1, "H": 3, "W": 4})
    outputs, _ = prepared.launch({"light": device.upload(light)})
    np.testing.assert_array_equal(device.download(outputs["twice"]), 2 * light)
    assert kernel_source(twice).count("TWO = 2") == 1


@pytest.mark.parametrize(
    ("file", "before", "after", "message"),
    [
        ("twice.cl", "TWO * light[i]", "lihgt[i]", "acme_twice/twice.cl:10:"),
        ("inner.clh", "};", "}; int f(void) { return g; }", "acme_twice/inner.clh:1:"),
        ("outer.clh", "inner.clh", "iner.clh", r"there is no iner\.clh in acme_twice"),
        (
            "twice.cl",
            "const int K, const int H",
            "const int H, const int K",
            "argument 3 is 'int H', but the declaration says 'int K'",
        ),
    ],
)
def test_an_error_in_a_kernel_is_reported_with_file_and_line(
    device: OpenCL, twice: Node, tmp_path: Path, file: str, before: str, after: str, message: str
) -> None:
    path = tmp_path / "acme_twice" / file
    path.write_text(path.read_text().replace(before, after))
    with pytest.raises(NodeError, match=message):
        device.compiled(twice).kernels_with({})
