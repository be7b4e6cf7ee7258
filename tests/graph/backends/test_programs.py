"""What one pipeline has built, the next one takes."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest

from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import find_node


def test_queues_of_a_device_share_a_program_and_disturb_no_launch(
    device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, sizes = find_node("threshold"), {"K": 2, "H": 3, "W": 4}
    light = np.full((2, 3, 4), 0.5, np.float32)
    low = device.prepare(node, {"level": 0.4, "lights": "all"}, sizes)
    built: list[object] = []
    monkeypatch.setattr(cl.Program, "build", lambda *given, **more: built.append(given))
    found, _ = choose_device()
    assert found is not None
    another = OpenCL(found)
    high = another.prepare(node, {"level": 0.6, "lights": "all"}, sizes)
    assert not built
    for queue, prepared, marked in ((device, low, 1), (another, high, 0), (device, low, 1)):
        (mask,) = prepared.launch({"light": queue.upload(light)})[0].values()
        assert (queue.download(mask) == marked).all()
