"""Presets for kinds of sensor: small files, shipped or the user's own."""

from pathlib import Path
from typing import Annotated, Literal, Self

from annotated_types import Interval, Len
from pydantic import BaseModel, ConfigDict

from tactograph.sdk import Document, InputError, PixelSize, brought

MAX_SETTING = 1e9
"""Largest size of a number for the driver, in the driver's unit."""
MAX_WAIT_S = 3600.0
Side = Annotated[int, Interval(ge=8, le=16384)]
Setting = Annotated[float, Interval(ge=-MAX_SETTING, le=MAX_SETTING)]
Share = Annotated[float, Interval(ge=0, le=1)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DriverSettings(_Part):
    """Settings to request from the camera's driver; None keeps the driver's."""

    width: Side | None = None
    height: Side | None = None
    rate: Annotated[float, Interval(gt=0, le=MAX_SETTING)] | None = None
    format: Annotated[str, Len(4, 4)] | None = None
    exposure: Setting | None = None
    gain: Setting | None = None
    white_balance: Setting | None = None


class SensorPreset(_Part):
    """A kind of sensor; ``sensors/gelsight_mini.yaml`` explains every value.

    `leds` is the number of LEDs that flash in turn; None: three colours are lit at once.
    """

    format: Literal[1]
    title: str = ""
    camera: DriverSettings = DriverSettings()
    turn_deg: Literal[0, 90, 180, 270] = 0
    crop: tuple[Share, Share, Share, Share] = (0.0, 0.0, 1.0, 1.0)
    size: tuple[Side, Side]
    lights: Literal["bgr", "rgb"] = "bgr"
    leds: Annotated[int, Interval(ge=3, le=8)] | None = None
    pixel_size_mm: PixelSize
    warm_up_s: Annotated[float, Interval(ge=0, le=MAX_WAIT_S)] = 0.0

    @classmethod
    def read(cls, sensor: str) -> Self:
        """Read a shipped preset by name, or the user's own by path.

        Raises
        ------
        InputError
            If there is none, or an entry is invalid; the message gives its place.
        """
        presets = shipped_presets()
        file = presets.get(sensor, Path(sensor))
        if file.suffix != ".yaml" or not file.is_file():
            raise InputError(
                f"`sensor`={sensor}: is neither a file (.yaml) nor one of {', '.join(presets)}"
            )
        document = Document.read(file)
        preset = document.checked(cls)
        left, top, right, bottom = preset.crop
        if left >= right or top >= bottom:
            raise InputError(f"{document.place(('crop',))}: nothing lies between {preset.crop}")
        return preset


def shipped_presets() -> dict[str, Path]:
    """Return the files of the presets that rings bring, by name."""
    return {name: each.file for name, each in sorted(brought("sensors", "yaml").items())}
