"""The device of a plan."""

from types import SimpleNamespace
from typing import Any

import pytest

from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.backends.device_queue import usual_lanes
from tactograph.graph.backends.devices import Device
from tactograph.graph.errors import InputError


def test_no_device_is_opened_that_nobody_asks_for() -> None:
    assert open_device(["numpy"]) == (None, "opencl is not among the preferred back ends")
    with pytest.raises(InputError, match="no OpenCL device's name contains 'none such'"):
        open_device(["numpy"], "none such")


@pytest.mark.parametrize(
    ("kind", "platform", "lanes"),
    [("CPU", "Portable Computing Language", 16), ("CPU", "rusticl", 1), ("GPU", "NVIDIA CUDA", 1)],
)
def test_work_items_process_several_elements_only_on_a_cpu_with_pocl(
    kind: str, platform: str, lanes: int
) -> None:
    handle: Any = SimpleNamespace(platform=SimpleNamespace(name=platform))
    assert usual_lanes(Device("", kind, handle, True, "works", False)) == lanes
