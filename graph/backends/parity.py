"""Parity: the generated proof that a node's implementations agree.

For every node with a kernel, the NumPy function is compared with the kernel over the cases of
`parity_cases`, within the node's tolerance.  Before the launch outputs hold garbage; after it
inputs have to be unchanged.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend, open_device
from tactograph.graph.backends.kernel import renamed
from tactograph.graph.backends.parity_cases import INTEGER_FILLS, Case, cases, make_inputs
from tactograph.graph.declare.engine_arguments import EVERYTHING, Wanted
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import InputError

Arrays = Mapping[str, NDArray[Any]]
"""Arrays by port."""
POISON_BYTE = 0xA5
MAX_DIFFERENCES = 5
"""Largest number of differences that a message lists."""


def check(node: Node, device: str | None = None) -> int:
    """Compare a node's kernel with its NumPy function over all generated cases.

    For the test of a node: ``def test_brighten(): parity.check(brighten)``.

    Parameters
    ----------
    device
        A part of the name of the OpenCL device to use; the first that works if left out.

    Returns
    -------
    The number of cases.

    Raises
    ------
    AssertionError
        Naming the cases that differ, and how.
    InputError
        If the node has no kernel, or no device works.
    NodeError
        If the kernel does not match the declaration, or does not compile.
    """
    if not node.has_kernel:
        raise InputError(f"node '{node.name}' has no kernel to compare; declare it with .opencl")
    opencl, reason = open_device(["opencl"], device)
    if opencl is None:
        raise InputError(f"no kernel can be compared: {reason}")
    compared = cases(node)
    differences = [(case, compare(node, case, opencl)) for case in compared]
    wrong = [f"  {case}: {difference}" for case, difference in differences if difference]
    more = [f"  and {len(wrong) - MAX_DIFFERENCES} more"] if len(wrong) > MAX_DIFFERENCES else []
    message = (
        f"node '{node.name}' differs on {opencl.name} in {len(wrong)} of {len(compared)} cases:"
    )
    assert not wrong, "\n".join([message, *wrong[:MAX_DIFFERENCES], *more])
    return len(compared)


def compare(node: Node, case: Case, *devices: DeviceBackend) -> str | None:
    """Run a case on NumPy once, and on devices; return the first difference, or None."""
    inputs = make_inputs(node, case)
    copies = {name: np.copy(v) for name, v in inputs.items() if isinstance(v, np.ndarray)}
    wanted = EVERYTHING if case.wanted is None else Wanted(frozenset(case.wanted))
    keywords = {**case.settings, **({node.wanted: wanted} if node.wanted else {})}
    reference = by_port(node, node(*node.in_order(inputs), **keywords))
    changed = _changed(inputs, copies)
    if changed:
        return f"the NumPy function changed its input '{changed}'"
    for device in devices:
        poisoned, device.poison = device.poison, POISON_BYTE
        try:
            launch = renamed(_on_device, f"the kernel of {node.name}, case {case}")
            outputs, after = launch(node, device, case, inputs, wanted)
        finally:
            device.poison = poisoned
        changed = _changed(after, copies)
        if changed:
            return f"the kernel changed its input '{changed}'"
        wrong = _difference(node, reference, outputs, wanted)
        if wrong:
            return wrong
    return None


def _difference(node: Node, reference: Arrays, outputs: Arrays, wanted: Wanted) -> str | None:
    for name, expected in reference.items():
        if name not in wanted:
            continue
        if expected.shape != outputs[name].shape:
            return f"{name}: shape {outputs[name].shape}, expected {expected.shape}"
        wrong = node.tolerance.difference(expected, outputs[name])
        if wrong:
            return f"{name}: {wrong}"
    return None


def _changed(inputs: Mapping[str, Any], before: Arrays) -> str | None:
    """Return the first input that has changed."""
    for name, array in before.items():
        equal_nan = array.dtype.kind == "f"
        if name in inputs and not np.array_equal(inputs[name], array, equal_nan=equal_nan):
            return name
    return None


def _on_device(
    node: Node, device: DeviceBackend, case: Case, inputs: Mapping[str, Any], wanted: Wanted
) -> tuple[Arrays, Arrays]:
    """The outputs, and the inputs after the launch."""
    integers = node.kernels.integers if case.fill in INTEGER_FILLS else None
    if integers is not None:
        dtype = INTEGER_FILLS[case.fill]
        full = np.iinfo(dtype).max
        inputs = {**inputs, integers: np.rint(inputs[integers] * full).astype(dtype)}
    remote = {
        name: device.upload(value) if isinstance(value, np.ndarray) else value
        for name, value in inputs.items()
        if node.inputs[name].kind != "object"
    }
    sizes = _stated_sizes(node, case)
    outputs, _ = device.prepare(node, case.settings, sizes, wanted).launch(remote)
    downloaded = {name: device.download(array) for name, array in outputs.items()}
    after = {n: device.download(a) for n, a in remote.items() if isinstance(a, DeviceArray)}
    if integers is not None:
        after[integers] = after[integers] / np.float32(full)
    return downloaded, after


def _stated_sizes(node: Node, case: Case) -> dict[str, int]:
    """The sizes of the ports that are present."""
    ports = [port for name, port in node.inputs.items() if name not in case.omitted]
    dims = {dim for port in (*ports, *node.outputs.values()) for dim in port.dims}
    return {symbol: size for symbol, size in case.sizes.items() if symbol in dims}


def by_port(node: Node, results: Any) -> dict[str, NDArray[Any]]:
    """A node's results by output."""
    return dict(zip(node.outputs, node.results(results), strict=True))
