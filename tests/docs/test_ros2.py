"""The part of the ROS 2 node that needs no ROS."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from types import ModuleType

import numpy as np
import pytest

from tests.conftest import ROOT

SCRIPT = ROOT / "docs" / "ros2" / "height_node.py"


@pytest.fixture(scope="module")
def ros2() -> ModuleType:
    spec = importlib.util.spec_from_file_location("height_node", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("encoding", "dtype"), [("mono8", np.uint8), ("mono16", np.uint16)])
def test_a_stack_is_whole_when_every_led_has_a_frame(
    ros2: ModuleType, encoding: str, dtype: type
) -> None:
    touches = ros2.Touches(3)
    size = np.dtype(dtype).itemsize
    for led in (2, 3, 1):
        # ROS pads rows to `step` bytes.
        padded = np.full((4, 5 * size + 3), 255, np.uint8)
        padded[:, : 5 * size] = np.full((4, 5), 10 * led, dtype).view(np.uint8)
        stack = touches.add(f"led{led}", encoding, (4, 5), 5 * size + 3, padded.tobytes())
    assert stack.dtype == dtype
    np.testing.assert_array_equal(stack, np.full((3, 4, 5), [[[10]], [[20]], [[30]]]))


@pytest.mark.parametrize("frame", ["led4", "led0", "camera", "led", "LED1"])
def test_a_frame_of_no_led_is_refused(ros2: ModuleType, frame: str) -> None:
    with pytest.raises(ValueError, match="led1 to led3 are known"):
        ros2.Touches(3).add(frame, "mono8", (1, 1), 1, b"\0")


def test_a_coloured_frame_is_refused(ros2: ModuleType) -> None:
    with pytest.raises(ValueError, match="encoding 'bgr8'"):
        ros2.Touches(3).add("led1", "bgr8", (1, 1), 3, b"\0\0\0")


@pytest.mark.skipif(
    importlib.util.find_spec("rclpy") is not None, reason="ROS 2 is here; the node would start"
)
def test_without_ros_the_script_says_so() -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "source its setup file" in done.stderr
