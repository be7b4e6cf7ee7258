"""Either kind of calibration, and the film at rest from it."""

from pathlib import Path
from typing import NamedTuple

from tactograph.nodes import Dark, Light
from tactograph.nodes.calibrate.file.calibration import Calibration
from tactograph.nodes.calibrate.file.press_calibration import PRESS_CALIBRATION, PressCalibration
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.file.read_press_calibration import read_press_calibration
from tactograph.nodes.files.calibration_file import is_of_kind
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


def read_either(calibration: Path) -> Calibration | PressCalibration:
    """Read a calibration of flashed LEDs, or of a one-shot sensor.

    Raises
    ------
    InputError
        If it is neither.
    """
    if is_of_kind(calibration, PRESS_CALIBRATION):
        return read_press_calibration(file=calibration)
    return read_calibration(file=calibration)


def calibrated_film(calibration: Path) -> CalibratedFilm:
    """Return the film at rest of a calibration: see `read_either`."""
    known = read_either(calibration)
    return CalibratedFilm(known.flat, known.dark, isinstance(known, PressCalibration))
