"""Every node with a kernel gives the same result on both back ends."""

from __future__ import annotations

import pytest

from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.find import builtin_names, find_node
from tactograph.graph.parity import Case, cases, compare

KERNEL_NODES = [name for name in builtin_names() if find_node(name).has_kernel]
CASES = [(name, case) for name in KERNEL_NODES for case in cases(find_node(name))]


@pytest.mark.parametrize(("name", "case"), CASES, ids=[f"{n}-{c}" for n, c in CASES])
def test_both_back_ends_agree(device: OpenCL, name: str, case: Case) -> None:
    assert compare(find_node(name), device, case) is None


@pytest.mark.parametrize("name", KERNEL_NODES)
def test_a_kernels_signature_matches_the_declaration(name: str) -> None:
    assert f"void {name}(" in kernel_source(find_node(name)) or find_node(name).launch


def test_every_pixel_node_of_the_paper_has_a_kernel() -> None:
    assert {
        "flat_field",
        "ball_slopes",
        "height_slopes",
        "label_lit",
        "shadow_linear",
        "refine_taylor",
        "integrate_dct",
        "integrate_frankot_chellappa",
        "rest_at_border",
    } <= set(KERNEL_NODES)
