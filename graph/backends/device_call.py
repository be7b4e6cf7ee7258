"""Run a node on the device when another node calls it on the host."""

import inspect
from collections.abc import Mapping
from typing import Any

import numpy as np

from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import make_record
from tactograph.graph.errors import DeviceError, NodeError


class DeviceCall:
    """A node that runs on a device when it is called with arrays on the host.

    Its `repr` names everything but the arguments that its results depend on.
    """

    def __init__(self, node: Node, device: DeviceBackend) -> None:
        self._node, self._device = node, device
        self._defaults = {name: p.default for name, p in node.parameters.items() if not p.required}

    def __repr__(self) -> str:
        return f"{self._node.name} on {self._device.name}, driver {self._device.driver}"

    def __call__(self, *inputs: Any, **settings: Any) -> Any:
        """Run the node as `Node.__call__` does; wait for it.

        Raises
        ------
        NodeError
            If two inputs disagree on a size, or the device fails (`DeviceError`).
        """
        node, device = self._node, self._device
        arrays = node.by_port(inputs)
        if self._is_idle(arrays):
            return node(*inputs, **settings)
        settings = {**self._defaults, **settings}
        sizes = self._sizes(arrays, settings)
        try:
            sent = {name: self._sent(name, value) for name, value in arrays.items()}
            outputs, _ = device.prepare(node, settings, sizes).launch(sent)
            values = [device.download(outputs[name]) for name in node.outputs]
        except device.error as error:
            raise DeviceError(f"{device.name} failed at {node.name}: {error}") from error
        return values[0] if node.output_record is None else make_record(node.output_record, values)

    def _is_idle(self, arrays: Mapping[str, Any]) -> bool:
        is_idle = self._node.is_idle
        if is_idle is None:
            return False
        values = {name.replace(".", "_"): value for name, value in arrays.items()}
        return is_idle(**{name: values[name] for name in inspect.signature(is_idle).parameters})

    def _sizes(self, arrays: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, int]:
        sizes: dict[str, int] = {}
        for name, value in arrays.items():
            port = self._node.inputs[name]
            if port.kind == "array" and value is not None:
                for dim, size in zip(port.dims, np.shape(value), strict=True):
                    due = dim if isinstance(dim, int) else sizes.setdefault(dim, size)
                    if due != size:
                        raise NodeError(
                            f"{self._node.name}: {dim} is {size} in '{name}', not {due}"
                        )
        derived = self._node.derived.items()
        return sizes | {symbol: parts.size(sizes, settings) for symbol, parts in derived}

    def _sent(self, name: str, value: Any) -> Any:
        port = self._node.inputs[name]
        if port.kind != "array" or value is None:
            return value
        return self._device.upload(np.ascontiguousarray(value, port.dtype))
