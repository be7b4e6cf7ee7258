"""Gwyddion's own: a channel for the height, and one for the error; unknown film is masked."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import milli

from tactograph.rings.metrology.formats._in_metres import package_for, read_in_metres
from tactograph.sdk import Height, HeightError, HeightFile, InputError

ERROR_TITLE = "Error"
"""The channel that holds the standard deviation of the heights."""


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm, and their standard deviation if it is known."""
    gwy = package_for("gwy", "gwyfile")
    container = gwy.objects.GwyContainer()
    container.filename = file.name
    for number, (title, data) in enumerate((("Height", height), (ERROR_TITLE, error))):
        if data is not None:
            is_known = np.isfinite(data)
            container[f"/{number}/data"] = _field(gwy, np.where(is_known, data, 0), pixel)
            container[f"/{number}/data/title"] = title
            if not is_known.all():
                container[f"/{number}/mask"] = _field(gwy, ~is_known, pixel)
    container.tofile(str(file))


def read(file: Path) -> HeightFile:
    """Read the first channel, and the one that is called its error."""
    return read_in_metres(file, _channels)


def _field(gwy: Any, data: Any, pixel: float) -> Any:
    rows, columns = data.shape
    unit = gwy.objects.GwySIUnit(unitstr="m")
    scale = 1.0 if data.dtype == bool else milli
    return gwy.objects.GwyDataField(
        scale * data.astype(np.float64),
        xreal=milli * pixel * columns,
        yreal=milli * pixel * rows,
        si_unit_xy=unit,
        si_unit_z=unit,
    )


def _channels(file: Path) -> Sequence[Any]:
    """The file must be as long as it says: gwyfile never ends at a string cut off."""
    gwy = package_for("gwy", "gwyfile")
    head = len(b"GWYPGwyContainer\0")
    if file.read_bytes()[head : head + 4] != np.uint32(file.stat().st_size - head - 4).tobytes():
        raise ValueError("it is not as long as it says")
    container = gwy.load(str(file))
    titles = dict(gwy.util.find_datafields(container))
    if not titles:
        raise InputError(f"{file}: holds no channel of heights")
    first = min(titles)
    field = container[f"/{first}/data"]
    width, length = field.xreal / field.data.shape[1], field.yreal / field.data.shape[0]
    numbers = first, *(number for number, title in titles.items() if title == ERROR_TITLE)
    return width, length, *(_measured(container, number, file) for number in numbers[:2])


def _measured(container: Any, number: int, file: Path) -> Any:
    """A channel, NaN where it is masked."""
    field, mask = container[f"/{number}/data"], container.get(f"/{number}/mask")
    if any(unit is None or unit.unitstr != "m" for unit in (field.si_unit_xy, field.si_unit_z)):
        raise InputError(f"{file}: its lengths are not in metres, so it holds no height map")
    return field.data if mask is None else np.where(np.asarray(mask.data) > 0, np.nan, field.data)
