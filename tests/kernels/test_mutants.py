"""The parity suite can fail: it catches every one of these deliberate mistakes."""

from __future__ import annotations

import pytest

from tactograph.graph.backends import opencl
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.find import builtin_names, find_node
from tactograph.graph.node import Node
from tactograph.graph.parity import cases, compare

MUTANTS = {
    "flat_field": {
        "dark not subtracted": ("(image[i] - dark[pixel])", "image[i]"),
        "floor ignored": ("fmax(flat[i], floor_)", "flat[i]"),
        "light of the first LED for all": ("image[i]", "image[pixel]"),
    },
    "ball_slopes": {
        "p and q swapped": ("? -dx / z", "? -dy / z"),
        "margin ignored": ("(contact - margin_px)", "contact"),
        "sign of q": ("? -dy / z", "? dy / z"),
    },
    "height_slopes": {
        "border not one-sided": ("/ max(right - left, 1)", "/ 2"),
        "not divided by the pixel": ("/ max(below - above, 1) / pixel", "/ max(below - above, 1)"),
        "mask inverted": ("<= steepest", "> steepest"),
    },
    "label_lit": {
        "LEDs counted from 1": ("1 << k", "2 << k"),
        "dark instead of lit": ("> black", "<= black"),
    },
    "shadow_linear": {
        "sign kept": ("fabs(departure)", "departure"),
        "brightest instead of darkest": ("value < least", "value > least"),
        "spread forgotten": ("threshold * spread", "threshold"),
    },
    "lut_nearest": {
        "the farther child only": (
            "const int nearer = right < left;",
            "const int nearer = right > left; depth = 0;",
        ),
        "the stack forgotten": ("if (here <= farthest(&nearest)) node = stack[depth];", ""),
        "the full table for all": ("table = k + 1;", "table = 0;"),
        "the brightest shadowed LED": ("value[k] < least)", "value[k] > -least)"),
        "one neighbour too few": (
            "nearest.wanted = neighbours;",
            "nearest.wanted = max(neighbours - 1, 1);",
        ),
    },
    "refine_taylor": {
        "shadowed pixels too": ("shadow[i] ? 0 : steps", "steps"),
        "limit ignored": ("limit * square", "1e9f * square"),
        "one harmonic's sign": ("l[7] * (x * x - y * y)", "l[7] * (x * x + y * y)"),
        "off-diagonal sign": ("(c * u - b * v)", "(c * u + b * v)"),
    },
    "integrate_dct": {
        "half forgotten": ("(p[i] + p[i + 1]) * 0.5f", "(p[i] + p[i + 1])"),
        "not in mm": ("* inverse[i] * pixel", "* inverse[i]"),
        "open border": ("x + 1 < W ?", "x < W ?"),
    },
    "integrate_frankot_chellappa": {
        "u and v swapped": ("(u * p + v * q) * scale", "(v * p + u * q) * scale"),
        "conjugate": ("(float2)(sum.y, -sum.x)", "(float2)(-sum.y, sum.x)"),
        "mirrored sign": ("out[y * W + x] = -(u", "out[y * W + x] = (u"),
    },
    "rest_at_border": {
        "upper median": ("total > middle", "total > middle + 1"),
        "added": ("- median[0]", "+ median[0]"),
        "top rows only": ("|| y >= H - border", ""),
    },
}
LISTED = [(name, what) for name, mutants in MUTANTS.items() for what in mutants]


@pytest.mark.parametrize(("name", "what"), LISTED, ids=[f"{n}: {w}" for n, w in LISTED])
def test_parity_catches(name: str, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = MUTANTS[name][what]

    def mutated(node: Node) -> str:
        source = kernel_source(node)
        assert before in source, "the mutant no longer fits the kernel"
        return source.replace(before, after)

    monkeypatch.setattr(opencl, "kernel_source", mutated)
    found, _ = choose_device()
    assert found is not None
    device, node = OpenCL(found), find_node(name)
    assert any(compare(node, device, case) for case in cases(node))


def test_every_kernel_of_the_flow_has_mutants() -> None:
    kernels = {name for name in builtin_names() if find_node(name).has_kernel}
    assert kernels - set(MUTANTS) <= {"render", "press"}, "tested against analytic scenes instead"
