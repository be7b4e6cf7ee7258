"""Plan a graph: run all passes in order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tactograph.graph.errors import InputError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan import backends, names, order, ports, sizes, transfers
from tactograph.graph.plan.plan import Plan

if TYPE_CHECKING:
    from tactograph.graph.backends.device_backend import DeviceBackend


def make_plan(
    graph: Graph,
    arguments: Mapping[str, Any],
    *,
    device: DeviceBackend | None,
    no_device: str = "",
    sinks: bool = True,
    stand_ins: frozenset[str] = frozenset(),
    outputs: Mapping[str, str] | None = None,
    stays: bool = False,
) -> Plan:
    """Verify `graph` and plan its run, without running or writing anything.

    Parameters
    ----------
    arguments : values of the graph's params
    device, no_device : the device to use, or None and the reason
    sinks : whether nodes that only write (files, pictures) are part of the run
    stand_ins : source nodes whose items the caller will hand in as arrays
    outputs : references by name, in place of the graph's own outputs
    stays : whether arrays among the outputs are left on the device

    Raises
    ------
    GraphError
        If the graph does not verify; the message names the place.
    InputError
        If a param is missing, or arrays are to stay on a device that no node uses.
    """
    draft = names.bind(graph, arguments, sinks=sinks, stand_ins=stand_ins, outputs=outputs)
    if stays:
        draft.stays = {v for v in draft.outputs.values() if draft.port_of(v).kind == "array"}
    ports.check(draft)
    classes = sizes.unify(draft)
    placements = backends.place(draft, device, no_device)
    if stays and not any(placement.on_device for placement in placements.values()):
        why = f": {no_device}" if no_device else ""
        raise InputError(f"{graph.name}: to='device': none of its nodes runs on a device{why}")
    steps = order.order(*transfers.insert(draft, placements), draft)
    return Plan(
        **vars(draft),
        arguments=dict(arguments),
        placements=placements,
        sizes=classes,
        steps=steps,
        device=device.name if device else None,
    )
