"""The film at rest of a calibration of any kind."""

from pathlib import Path
from typing import NamedTuple

from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.sdk import Dark, FileKind, Light, LiveState


class CalibratedFilm(NamedTuple):
    """Flat frame, K x H x W; dark image, H x W; whether it is a one-shot sensor's."""

    flat: Light
    dark: Dark
    one_shot: bool

    @property
    def touch(self) -> LiveFrames:
        """A touch that shows the film at rest, for rehearsals."""
        return LiveFrames(self.flat + self.dark, "", 0.0, [], LiveState())


def calibrated_film(calibration: Path) -> CalibratedFilm:
    """Return the film at rest of a calibration: see `FileKind.read_sensor`."""
    sensor = FileKind.read_sensor(calibration)
    return CalibratedFilm(sensor.flat, sensor.dark, not hasattr(sensor, "film"))
