"""A launch that is repeated with its arguments set works on the present content of its buffers."""

from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity_cases import Case, cases, make_inputs
from tactograph.graph.declare.find_node import find_node
from tests.kernels.test_parity import KERNEL_NODES


def first_case(name: str, fill: str) -> Case:
    return next(c for c in cases(find_node(name), shapes=((31, 37),)) if c.fill == fill)


@pytest.mark.one_case
@pytest.mark.parametrize("name", KERNEL_NODES)
def test_a_repeated_launch_gives_the_result_of_a_first_one(device: OpenCL, name: str) -> None:
    node = find_node(name)
    before, now = (make_inputs(node, first_case(name, fill)) for fill in ("random", "edges"))
    numbers = {n: v for n, v in before.items() if not isinstance(v, np.ndarray)}
    case = first_case(name, "random")
    ports = (*node.inputs.values(), *node.outputs.values())
    known = {dim for port in ports for dim in port.dims}
    sizes = {symbol: size for symbol, size in case.sizes.items() if symbol in known}
    uploaded = {n: device.upload(v) for n, v in before.items() if n not in numbers}
    inputs: dict[str, Any] = {**uploaded, **numbers}
    prepared = device.prepare(node, case.settings, sizes)
    for _ in range(3):
        prepared.launch(inputs)
    # Two films have different numbers of rises.
    alike = {n: array for n, array in uploaded.items() if now[n].shape == array.shape}
    assert alike
    for n, array in alike.items():
        cl.enqueue_copy(device.queue, array.buffer, np.ascontiguousarray(now[n]))
    repeated = downloaded(device, prepared.launch(inputs)[0])
    expected = downloaded(device, device.prepare(node, case.settings, sizes).launch(inputs)[0])
    for port, array in expected.items():
        assert repeated[port].shape == array.shape
        assert node.tolerance.difference(array, repeated[port]) is None, port


def downloaded(device: OpenCL, outputs: dict[str, DeviceArray]) -> dict[str, Any]:
    return {name: device.download(array) for name, array in outputs.items()}
