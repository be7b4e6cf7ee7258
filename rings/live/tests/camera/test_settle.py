"""What is requested of a camera's driver."""

import cv2
import pytest

from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, settle


class Driver:
    """A driver that takes what it is asked for."""

    def __init__(self) -> None:
        self.set_to: dict[int, float] = {}

    def getBackendName(self) -> str:  # noqa: N802  (OpenCV's name)
        return "V4L2"

    def set(self, prop: int, value: float) -> bool:
        self.set_to[prop] = value
        return True

    def get(self, prop: int) -> float:
        return -1.0 if prop == cv2.CAP_PROP_GAIN else self.set_to[prop]


@pytest.mark.parametrize(("name", "raw"), [("Y10 ", 0.0), ("MJPG", None)])
def test_of_a_grey_format_of_many_bits_all_are_wanted(name: str, raw: float | None) -> None:
    driver = Driver()
    assert not settle(driver, CameraSettings(640, 480, 30.0, format=name))  # type: ignore[arg-type]
    assert driver.set_to.get(cv2.CAP_PROP_CONVERT_RGB) == raw


def test_what_the_driver_refuses_is_said() -> None:
    (line,) = settle(Driver(), CameraSettings(640, 480, 30.0, gain=2.0))  # type: ignore[arg-type]
    assert line == "the camera keeps gain at -1 instead of 2"
