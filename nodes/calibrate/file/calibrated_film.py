"""The film at rest of a calibration of any kind."""

from pathlib import Path
from typing import Any, NamedTuple

from tactograph.nodes import Dark, Light
from tactograph.nodes.calibrate.file.calibration import Calibration
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.files.calibration_file import kind_of
from tactograph.nodes.stream.frames import LiveFrames, LiveState


class CalibratedFilm(NamedTuple):
    """Flat frame, K x H x W; dark image, H x W; whether it is a one-shot sensor's."""

    flat: Light
    dark: Dark
    one_shot: bool

    @property
    def touch(self) -> LiveFrames:
        """A touch that shows the film at rest, for rehearsals."""
        return LiveFrames(self.flat + self.dark, "", 0.0, [], LiveState())


def read_either(calibration: Path) -> Any:
    """Read a `Calibration` of flashed LEDs, or one of a one-shot sensor.

    Raises
    ------
    InputError
        If it is neither.
    """
    kind = kind_of(calibration)
    if kind is None or "flat" not in kind.KIND.values:
        return read_calibration(file=calibration)
    return kind.read(calibration)


def calibrated_film(calibration: Path) -> CalibratedFilm:
    """Return the film at rest of a calibration: see `read_either`."""
    sensor = read_either(calibration)
    return CalibratedFilm(sensor.flat, sensor.dark, not isinstance(sensor, Calibration))
