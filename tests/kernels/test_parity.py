"""Every node with a kernel gives the same result on both back ends."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from tactograph.graph.backends import parity
from tactograph.graph.backends.device_queue import usual_lanes
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel_source import (
    expected_arguments,
    kernel_signatures,
    kernel_source,
)
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import CASE_SHAPES, Case, cases
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node import Node
from tactograph.nodes import F4, Light
from tactograph.nodes.height import height_networks
from tests.each import each
from tests.graph.toys import halves, leaned
from tests.kernels.pairwise import pairwise

KERNEL_NODES = [name for name in shipped_nodes() if find_node(name).has_kernel]
VKFFT = ("integrate_frankot_chellappa",)
"""Nodes whose kernels need what 'make test' does not install; all their cases are slow."""
COSTLY = ("render",)
"""Nodes for which extremes that meet take minutes; there one parameter at a time is extreme."""
LANED = [name for name in KERNEL_NODES if "LANES" in kernel_source(find_node(name))]
"""Nodes whose work-items do several elements side by side."""


@pytest.fixture(scope="module")
def one_lane(request: pytest.FixtureRequest) -> OpenCL | None:
    """The device as if it were a GPU, whose work-items do one element each.

    None where they do so anyway, and on PoCL 5.0, which aborts on barriers in loops; only a GPU's
    groups have those.
    """
    chosen, _ = choose_device(request.config.getoption("--device"))
    if usual_lanes(chosen) == 1 or "PoCL 5.0" in chosen.handle.platform.version:
        return None
    return OpenCL(chosen, lanes=1)


@pytest.fixture(scope="module")
def only_small(request: pytest.FixtureRequest) -> bool:
    """Whether kernels are compared on small images only."""
    return bool(request.config.getoption("--small-images"))


def pairs(node: Node) -> list[Case]:
    """Cases in which any two choices meet on small images."""
    costly = node.name in COSTLY
    return cases(node, CASE_SHAPES[1:3]) if costly else pairwise(node, CASE_SHAPES[:3])


def large_images(node: Node) -> list[Case]:
    """Cases of large images that hold random values."""
    every = cases(node, CASE_SHAPES[3:])
    return [case for case in every if (case.fill, case.setting) == ("random", "default")]


@pytest.mark.parametrize(
    "node", [leaned, halves, find_node("label_lights")], ids=lambda node: node.name
)
def test_any_two_choices_meet(node: Node) -> None:
    rows = [
        {"H": c.sizes["H"], "fill": c.fill, "without": c.omitted, "only": c.wanted, **c.settings}
        for c in pairwise(node)
    ]
    for one, other in combinations(rows[0], 2):
        met = {(row[one], row[other]) for row in rows}
        assert met == {(row[one], another[other]) for row in rows for another in rows}


def differences(devices: list[OpenCL], name: str, chosen: list[Case]) -> dict[str, str]:
    """The differences on any device, by case."""
    results = {str(case): compare(find_node(name), case, *devices) for case in chosen}
    return {case: what for case, what in results.items() if what}


@pytest.fixture(scope="module")
def as_written(request: pytest.FixtureRequest) -> OpenCL:
    """The device without its compiler's optimisations, which take half of the time."""
    chosen, _ = choose_device(request.config.getoption("--device"))
    assert chosen is not None
    device = OpenCL(chosen)
    device.options.append("-cl-opt-disable")
    return device


@pytest.mark.parametrize("name", [name for name in KERNEL_NODES if name not in VKFFT])
def test_both_back_ends_agree(as_written: OpenCL, name: str, only_small: bool) -> None:
    node = find_node(name)
    chosen = pairs(node) if only_small else large_images(node) + pairs(node)
    assert differences([as_written], name, chosen) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", KERNEL_NODES)
def test_back_ends_agree_in_every_case(device: OpenCL, one_lane: OpenCL | None, name: str) -> None:
    """Also where work-items do one element each.  Large images hold random values alone there, as
    other values matter on small images."""
    node = find_node(name)
    every = cases(node) + ([] if name in COSTLY else pairwise(node))
    lanes = [device, one_lane] if one_lane and name in LANED else [device]
    large = [case for case in every if case.sizes.get("H", 0) >= 64 and case.fill != "random"]
    assert differences(lanes, name, [case for case in every if case not in large]) == {}
    assert differences([device], name, large) == {}


# Springs of no stiffness lead beyond the frame: a product with zero, but for NaN.  Frames of
# cameras have levels too large for a group, and these do if a group does no more than this.
@pytest.mark.parametrize(
    ("module", "name", "value"),
    [(parity, "POISON_BYTE", 0xFF), (height_networks, "ONE_GROUP_PIXELS", 32)],
    ids=["what a buffer held before is NaN", "a group does few pixels"],
)
@pytest.mark.parametrize("node", ["integrate_weighted", "height_error"])
def test_the_height_is_the_same_if(
    as_written: OpenCL, node: str, module: object, name: str, value: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(module, name, value)
    chosen = cases(find_node(node), shapes=((31, 37), (70, 131)))[:4]
    assert differences([as_written], node, chosen) == {}


@pytest.mark.one_case
@pytest.mark.parametrize("lights", [3, 5, 8])
@pytest.mark.parametrize("name", LANED)
def test_both_back_ends_agree_for_any_number_of_lights(
    as_written: OpenCL, name: str, lights: int
) -> None:
    node = find_node(name)
    if "K" in node.sizes and node.sizes["K"].refuses(lights):
        pytest.skip(node.sizes["K"].why)
    every = cases(node, shapes=((33, 47),))
    # Settings at their extremes once more where there are most lights.
    for case in every if lights == 8 else [c for c in every if c.setting == "default"]:
        other = replace(case, sizes={**case.sizes, "K": lights})
        assert compare(node, other, as_written) is None, str(other)


@pytest.mark.parametrize(
    ("name", "chosen"),
    [
        ("integrate_dct", cases(find_node("integrate_dct"), shapes=((67, 48), (71, 70)))),
        ("lut_nearest", cases(find_node("lut_nearest"), shapes=((190, 180),))[:6]),
    ],
    ids=["an image whose height is prime is turned over", "many cells of a large frame"],
)
def test_both_back_ends_agree_on(as_written: OpenCL, name: str, chosen: list[Case]) -> None:
    assert differences([as_written], name, chosen) == {}


@each("name", KERNEL_NODES)
def test_a_kernels_signature_matches_the_declaration(name: str) -> None:
    node = find_node(name)
    signatures = kernel_signatures(kernel_source(node))
    if node.kernels.launch is None:
        assert signatures[name] == [
            (kind, word.rstrip("_")) for kind, word in expected_arguments(node)
        ]
    else:
        assert signatures


def test_every_pixel_node_of_the_paper_has_a_kernel() -> None:
    slopes = {"flat_field", "ball_slopes", "height_slopes"}
    shadows = {"label_lit", "shadow_linear", "refine_taylor"}
    heights = {"integrate_dct", "integrate_frankot_chellappa", "rest_at_border"}
    assert slopes | shadows | heights <= set(KERNEL_NODES)


def test_cases_leave_inputs_out_and_want_a_part_of_the_outputs() -> None:
    assert {case.omitted for case in cases(leaned)} == {(), ("table",)}
    assert {case.wanted for case in cases(halves)} == {None, ("low",), ("high",)}


@pytest.mark.parametrize("node", [leaned, halves], ids=lambda node: node.name)
def test_absent_inputs_and_outputs_are_the_same_on_both_back_ends(
    device: OpenCL, node: Node
) -> None:
    chosen = [case for case in cases(node) if case.omitted or case.wanted]
    assert [compare(node, case, device) for case in chosen] == [None] * len(chosen)


def test_a_kernel_that_needs_an_optional_input_is_detected(
    device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    def always(image: Light, table: F4 | None = None) -> Light:
        return image + np.float32(1)

    monkeypatch.setattr(leaned, "function", always)
    (without,) = (case for case in cases(leaned) if case.omitted)
    assert compare(leaned, without, device) is not None
