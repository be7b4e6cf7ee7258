"""A touch as a row of a LeRobot dataset: what its columns are called and hold.

LeRobot keeps pictures of three channels of 8 bits.  So a height is the picture of its 16-bit
levels (`height_levels`), and three lights are the channels of one picture.
"""

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.export.height_levels import OFFSET_MM, STEP_MM, UNKNOWN_LEVEL, height_levels
from tactograph.rings.frames.colour_planes import in_bytes
from tactograph.rings.recording.files.level_pictures import levels_picture
from tactograph.sdk import F4, InputError, Light, Touch, need

NS_PER_S = 10**9
PICTURE_CHANNELS = 3
INFO_FILE = Path("meta", "info.json")
"""What LeRobot says of a dataset."""


class Column(NamedTuple):
    """A column's value in one row, and what the dataset says of the column."""

    value: NDArray[Any]
    names: list[str] | None = None
    info: Mapping[str, Any] = {}

    @property
    def feature(self) -> dict[str, Any]:
        """The column as LeRobot declares it."""
        is_picture = self.value.ndim == PICTURE_CHANNELS
        named = ["height", "width", "channels"] if is_picture else self.names
        feature = {"dtype": "image" if is_picture else str(self.value.dtype)}
        return feature | {"shape": self.value.shape, "names": named, "info": dict(self.info)}


def height_column(sensor: str) -> str:
    """Return the name of a sensor's heights."""
    return f"observation.images.{sensor}_height"


def time_column(sensor: str) -> str:
    """Return the name of a sensor's times: whole seconds since 1970, and nanoseconds."""
    return f"{sensor}.time"


def touch_columns(
    touch: Touch,
    stamp: int,
    sensor: str,
    figures: list[str],
    contacts: int,
    origin: Mapping[str, str],
) -> dict[str, Column]:
    """Return a touch's columns by name.

    Parameters
    ----------
    touch, stamp : the touch, and its time in nanoseconds since 1970
    sensor : its name within the dataset
    figures, contacts : the figures that are kept of a contact, and of how many contacts
    origin : what the dataset says of the sensor and its calibration

    Raises
    ------
    InputError
        If the sensor's name is none, a height does not fit into 16 bits, or a contact lacks a
        figure.
    """
    if not sensor.isidentifier():
        raise InputError(f"`sensor`={sensor}: a name of letters, digits and underscores is needed")
    scale = {"unit": "mm", "step": STEP_MM, "offset": OFFSET_MM, "unknown_level": UNKNOWN_LEVEL}
    about = {"level": "256 * red + green", **scale, "pixel_size_mm": float(touch.pixel)}
    about |= {"sensor_name": sensor, **origin, **touch.view.stated()}
    height = Column(levels_picture(height_levels(touch.height)), info=about)
    columns = {height_column(sensor): height}
    leds = len(touch.image)
    for first in range(1, leds + 1, PICTURE_CHANNELS):
        numbers = list(range(first, min(first + PICTURE_CHANNELS, leds + 1)))
        picture = lights_picture(touch.image[first - 1 : first - 1 + PICTURE_CHANNELS])
        columns[f"observation.images.{sensor}_lights{first}"] = Column(
            picture, info={"lights": numbers}
        )
    if contacts:
        names = [f"{name}_c{n}" for n in range(1, contacts + 1) for name in figures]
        values = contact_figures(touch.metrics or {}, figures, contacts)
        columns[f"observation.{sensor}.contacts"] = Column(values, names)
    for layer in touch.each_layer():
        if layer.kind.state:
            state = layer.kind.state(layer.value)
            value = np.array([*state.values()], np.float32)
            columns[f"observation.{sensor}.{layer.name}"] = Column(value, [*state])
    columns[time_column(sensor)] = Column(np.array(divmod(stamp, NS_PER_S)), ["s", "ns"])
    return columns


def lights_picture(lights: Light) -> NDArray[np.uint8]:
    """Return up to three lights, 0 to 1, as the channels of a picture H x W x 3 of 8 bits."""
    picture = np.zeros((*lights.shape[1:], PICTURE_CHANNELS), np.uint8)
    picture[..., : len(lights)] = np.moveaxis(in_bytes(lights), 0, -1)
    return picture


def contact_figures(metrics: Mapping[str, Any], figures: list[str], contacts: int) -> F4:
    """Return the figures of contacts 1, 2 …, one contact after the other; 0: no such contact.

    Raises
    ------
    InputError
        If a contact lacks a figure.
    """
    values = np.zeros((contacts, len(figures)), np.float32)
    for number in range(1, contacts + 1):
        keys = {
            key for key in metrics if key.startswith("contact_") and key.endswith(f"/c{number}")
        }
        for column, name in enumerate(figures if keys else ()):
            if (key := f"contact_{name}/c{number}") not in keys:
                names = ", ".join(sorted(key[len("contact_") : key.index("/")] for key in keys))
                raise InputError(f"figures: '{name}' is not measured here; {names} are")
            values[number - 1, column] = metrics[key]
    return values.ravel()


def open_lerobot(folder: Path) -> Any:
    """Return the `LeRobotDataset` in a folder.

    Raises
    ------
    InputError
        If ``lerobot`` is not installed, or the folder holds no such dataset.
    """
    if not (folder / INFO_FILE).is_file():
        raise InputError(f"{folder}: is no LeRobot dataset, {INFO_FILE} is missing")
    try:
        return lerobot_dataset()(f"local/{folder.resolve().name}", root=folder)
    # A damaged or newer dataset can raise any exception.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{folder}: cannot be read as a LeRobot dataset: {reason}") from None


def lerobot_dataset() -> Any:
    """Return LeRobot's class of datasets.

    Raises
    ------
    InputError
        If ``lerobot`` is not installed.
    """
    need("lerobot", "a LeRobot dataset", "lerobot")
    return importlib.import_module("lerobot.datasets.lerobot_dataset").LeRobotDataset
