"""A launch function's arguments are checked and converted by the kernel's own signature."""

from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_source import kernel_signatures, kernel_source
from tactograph.graph.backends.launch import DeviceArray
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tests.each import each

SOURCE = """
#define SHARED __global const uchar *restrict labels, \\
    const int N
typedef float16 floats;
/* kernel void none(const int N) */
__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void fill(__global float *out, const float value, const int index, const uint key)
{ out[index] = value + key; }
__kernel void shared(SHARED, __global float2 *pairs, __local float *part) {}
__kernel void wide(__global floats *out) {}
"""


@pytest.fixture
def fill(device: OpenCL) -> Kernel:
    program = cl.Program(device.context, SOURCE).build()
    return Kernel(cl.Kernel(program, "fill"), kernel_signatures(SOURCE)["fill"])


def test_signatures_are_read_with_their_macros_and_attributes() -> None:
    signatures = kernel_signatures(SOURCE)
    assert signatures["fill"] == [
        ("float*", "out"), ("float", "value"), ("int", "index"), ("uint", "key")
    ]  # fmt: skip
    assert signatures["shared"] == [
        ("uchar*", "labels"), ("int", "N"), ("float2*", "pairs"), ("float*", "part")
    ]  # fmt: skip
    assert signatures["wide"] == [("float16*", "out")]
    assert signatures.keys() == {"fill", "shared", "wide"}


@pytest.mark.parametrize("value", [2, 2.0, np.float64(2), np.int64(2), np.float32(2)])
def test_a_number_is_converted_to_the_type_of_the_kernel(
    device: OpenCL, fill: Kernel, value: Any
) -> None:
    out = device.upload(np.zeros(2, np.float32))
    arguments = fill.converted([out, value, np.int64(1), 3])
    fill.bind(device.queue, (1,), (1,), arguments)()
    assert device.download(out).tolist() == [0, 5]


@pytest.mark.parametrize(
    ("number", "value", "complaint"),
    [
        (0, 1.5, r"argument 1 is 'float\* out', not 1.5 \(float\)"),
        (0, DeviceArray(None, (2,), np.dtype(np.int32)), "not an array of int32"),
        (1, None, "argument 2 is 'float value', not None"),
        (1, "2", r"not '2' \(str\)"),
        (2, 1.0, r"argument 3 is 'int index', not 1.0 \(float\)"),
        (2, 2**31, "not 2147483648"),
        (2, np.int64(2**31), "2147483648"),
        (3, -1, "argument 4 is 'uint key', not -1"),
    ],
)
def test_an_argument_that_a_kernel_cannot_take_is_refused(
    device: OpenCL, fill: Kernel, number: int, value: Any, complaint: str
) -> None:
    arguments: list[Any] = [device.upload(np.zeros(2, np.float32)), 1.0, 1, 1]
    arguments[number] = value
    with pytest.raises(TypeError, match=complaint):
        fill.converted(arguments)


def test_a_copy_keeps_the_arguments_that_it_was_bound_to(device: OpenCL, fill: Kernel) -> None:
    """Its arguments hold for every launch, whatever the kernel itself is launched with."""
    out = device.upload(np.zeros(3, np.float32))
    first, second = (
        fill.numbered_copy(index).bind(
            device.queue, (1,), (1,), fill.converted([out, index + 1, index, 0])
        )
        for index in range(2)
    )
    for launch in (first, second, first):
        fill.bind(device.queue, (1,), (1,), fill.converted([out, 7, 2, 0]))()
        launch()
        assert device.download(out)[2] == 7
    assert device.download(out).tolist() == [1, 2, 7]
    assert fill.numbered_copy(0) is fill.numbered_copy(0)
    assert fill.numbered_copy(0) is not fill.numbered_copy(1)


def test_a_missing_argument_is_reported_with_the_known_ones(device: OpenCL, fill: Kernel) -> None:
    with pytest.raises(TypeError, match=r"takes 4 arguments \(out, value, index, key\), not 1"):
        fill.converted([1])


@each("name", [n for n in shipped_nodes() if find_node(n).has_kernel])
def test_every_kernel_that_ships_has_a_signature_with_known_types(name: str) -> None:
    node = find_node(name)
    signatures = kernel_signatures(kernel_source(node))
    assert signatures
    for arguments in signatures.values():
        assert all(c_type and name for c_type, name in arguments)
        bases = {c_type.rstrip("*").rstrip("0123456789") for c_type, _ in arguments}
        assert bases <= {"float", "int", "uint", "uchar", "ushort", "PIXEL"}
