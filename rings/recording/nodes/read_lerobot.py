"""Read touches from a LeRobot dataset."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tactograph.rings.export.height_levels import level_height
from tactograph.rings.frames.colour_planes import MAX_BYTE
from tactograph.rings.recording.files.lerobot_rows import (
    NS_PER_S,
    height_column,
    open_lerobot,
    time_column,
)
from tactograph.rings.recording.files.level_pictures import picture_levels
from tactograph.rings.recording.files.stamps import day_offset_ns
from tactograph.sdk import Height, InputError, Labels, Light, Port, SensorIdentity, Slope, node
from tactograph.sdk.nodes import read_capture


class DatasetTouch(NamedTuple):
    """The lights of a touch, and the height that was kept of it; what is true is never known."""

    image: Light
    name: str
    time: Annotated[float, Port(unit="s")]
    recorded: Height
    truth: Height | None = None
    truth_slope: Slope | None = None
    truth_shadow: Labels | None = None
    truth_rest: Height | None = None


@node
def read_lerobot(
    *,
    dataset: Path,
    calibration: Path | None = None,
    another_sensor: bool = False,
    sensor: str = "touch",
    episode: Annotated[int, Ge(0)] | None = None,
) -> Iterator[DatasetTouch]:
    """Yield the rows that `write_lerobot` has written, each a touch.

    Parameters
    ----------
    dataset : folder of a dataset that `write_lerobot` has written
    calibration : touches of another sensor than the calibration's are refused
    another_sensor : take them on purpose, with a warning
    sensor : the sensor's name in the dataset
    episode : the episode's number, from 0; None: all, one after the other

    Returns
    -------
    The lights, 0 to 1, in 8 bits; a name, ``EPISODE_ROW``; the time of the exposure, on the clock
    of ``time.monotonic()``; and the height as it was computed then, in steps of 0.1 micrometres.

    Raises
    ------
    InputError
        If ``lerobot`` is not installed, or there is no such dataset, sensor or episode, or it is
        of another sensor than the calibration.
    """
    rows = open_lerobot(dataset)
    about = _height_info(dataset, rows, sensor)
    SensorIdentity.stated_in(about).check(dataset, calibration, another_sensor)
    if episode is not None and episode >= rows.num_episodes:
        raise InputError(f"{dataset}: has {rows.num_episodes} episodes; they count from 0")
    offset = day_offset_ns()
    step, zero, unknown = (float(about[name]) for name in ("step", "offset", "unknown_level"))
    begin = f"observation.images.{sensor}_lights"
    # The numbers of the lights in each picture, and its column.
    pictures = sorted(
        (f["info"]["lights"], name) for name, f in rows.features.items() if name.startswith(begin)
    )
    for number in range(len(rows)):
        row = rows[number]
        of, at = int(row["episode_index"]), int(row["frame_index"])
        if episode not in (None, of):
            continue
        levels = picture_levels(_bytes(row[height_column(sensor)]))
        recorded = level_height(levels, step, zero)
        recorded[levels == unknown] = np.nan
        planes = [_bytes(row[name])[..., : len(numbers)] for numbers, name in pictures]
        lights = np.concatenate(planes, axis=-1).transpose(2, 0, 1)
        image = lights.astype(np.float32) / np.float32(MAX_BYTE)
        seconds, parts = (int(number) for number in row[time_column(sensor)])
        moment = 1e-9 * (seconds * NS_PER_S + parts - offset)
        yield DatasetTouch(image, f"{of:04}_{at:06}", moment, recorded)


read_lerobot.handed_in(read_capture.check_handed_in)


def _height_info(dataset: Path, rows: Any, sensor: str) -> dict[str, Any]:
    """What the dataset says of a sensor's heights."""
    about = [feature.get("info") or {} for feature in rows.features.values()]
    sensors = [str(each["sensor_name"]) for each in about if "step" in each]
    if sensor not in sensors:
        has = f"`sensor`={' or '.join(sensors)}" if sensors else "none of 'write_lerobot'"
        raise InputError(f"{dataset}: there is no sensor '{sensor}'; it has {has}")
    info: dict[str, Any] = rows.features[height_column(sensor)]["info"]
    return info


def _bytes(picture: Any) -> NDArray[np.uint8]:
    """LeRobot's 3 x H x W tensor, 0 to 1, as H x W x 3 of bytes again."""
    values: NDArray[Any] = np.asarray(picture)
    return np.rint(values * MAX_BYTE).astype(np.uint8).transpose(1, 2, 0)
