"""The parameters by which a live node's camera is chosen and set."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

from annotated_types import Gt, Interval

from tactograph.rings.frames.rest_film import full_scale
from tactograph.rings.live.nodes.camera._camera_names import serial_of
from tactograph.rings.live.nodes.camera.open_camera import Library
from tactograph.sdk import SensorIdentity

SIMULATED_NAME = "simulated"


class UsedCalibration(NamedTuple):
    """The calibration that a live node's frames are for.

    Parameters
    ----------
    calibration : the sensor's calibration; its flat frame shows the film at rest
    another_sensor : take the calibration of a camera of another serial number, with a warning
    """

    calibration: Path
    another_sensor: bool = False


class CameraParams(NamedTuple):
    """A camera, and the settings requested of its driver.

    Parameters
    ----------
    camera
        Index, serial number (``serial:28F5K4RR``, see ``tactograph cameras``; of an industrial
        camera ``genicam:28F5K4RR``), device (``/dev/v4l/by-id/...``), URL or video file;
        ``simulated`` for a simulated sensor, with its scene behind a question mark:
        ``simulated?radius_mm=3&depth_mm=0.5``.
    library
        "opencv" opens the camera.  "linuxpy" (Linux only) adds the kernel's time and number of
        each frame, and all bits of grey frames (``pip install 'tactograph[linux]'``).
    rate : frames per second, and steps of LEDs that flash per second
    exposure, gain, white_balance
        In the driver's units; None keeps the driver's values.  Automatic control is turned off.
    bits : bit depth, if the camera uses fewer bits than its 16-bit frames hold
    timeout_s : time without a frame after which the camera is reopened
    sensor
        The sensor's kind, a preset such as "gelsight_mini" or "digit", or a file of your own.  It
        gives the camera's settings, how its pictures are rotated, cropped and scaled down, and the
        order of its colours or the number of LEDs that flash.  Start from a copy of
        ``rings/live/sensors/gelsight_mini.yaml``.
    """

    camera: int | str = 0
    library: Library = "opencv"
    rate: Annotated[float, Gt(0)] = 30.0
    exposure: float | None = None
    gain: float | None = None
    white_balance: float | None = None
    bits: Annotated[int, Interval(ge=8, le=16)] | None = None
    timeout_s: Annotated[float, Interval(gt=0, le=10)] = 0.5
    sensor: str | None = None

    @property
    def is_simulated(self) -> bool:
        """Whether the sensor is a simulated one."""
        return str(self.camera).partition("?")[0] == SIMULATED_NAME

    @property
    def full_scale(self) -> float:
        """The camera's largest value; 0: that of the frame's type."""
        return full_scale(self.bits)

    @property
    def serial(self) -> str:
        """The camera's serial number; empty if it has none."""
        return serial_of(str(self.camera))

    @property
    def stored(self) -> dict[str, Any]:
        """The settings that a recording keeps."""
        params = self._asdict() | {"camera": str(self.camera), "serial": self.serial}
        return {name: value for name, value in params.items() if name != "timeout_s"}

    def check_calibration(self, used: UsedCalibration) -> None:
        """Refuse the calibration of a camera of another serial number, as far as both are known.

        Raises
        ------
        InputError
            If it is another's and not taken on purpose.
        """
        SensorIdentity(serial=self.serial).check(f"`camera`={self.camera}", *used)
