"""Height maps in the formats of surface metrology: X3P, Gwyddion's .gwy and .gsf.

Lengths are metres in all of them.  Rows stay in the image's order, the first on top.
"""

import importlib
import math
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph import InputError
from tactograph.graph.extras import need
from tactograph.nodes import F4, Height, HeightError

METRES_PER_MM = 1e-3
"""A millimetre in metres."""
ERROR_TITLE = "Error"
"""The channel of a .gwy file that holds the standard deviation of the heights."""
SOFTWARE_NAME = "Tactograph"
"""What files of X3P name as their writer, and whose second layer is an error."""
NOT_METRES = "its lengths are not in metres, so it holds no height map"
_KIND_PACKAGES = {"x3p": "x3pio", "gwy": "gwyfile", "gsf": "gsffile"}


class MetrologyFile(NamedTuple):
    """Width and length of a pixel in mm; the height, and its standard deviation, H x W in mm."""

    width: float
    length: float
    height: F4
    error: F4 | None = None


def write_x3p(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """ISO 25178-72: 64-bit floats, NaN where unknown; the error is a second layer."""
    layers = [height] if error is None else [height, error]
    data = METRES_PER_MM * np.stack(layers).astype(np.float64)
    package, side = _package("x3p"), METRES_PER_MM * pixel
    about = package.Metadata.for_software(SOFTWARE_NAME, version("tactograph"))
    package.write(file, data, x_scale=side, y_scale=side, metadata=about)


def write_gwy(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Gwyddion's own: a channel for the height, and one for the error; unknown film is masked."""
    gwy = _package("gwy")
    container = gwy.objects.GwyContainer()
    container.filename = file.name
    for number, (title, data) in enumerate((("Height", height), (ERROR_TITLE, error))):
        if data is not None:
            known = np.isfinite(data)
            container[f"/{number}/data"] = _field(gwy, np.where(known, data, 0), pixel)
            container[f"/{number}/data/title"] = title
            if not known.all():
                container[f"/{number}/mask"] = _field(gwy, ~known, pixel)
    container.tofile(str(file))


def _field(gwy: Any, data: Any, pixel: float) -> Any:
    rows, columns = data.shape
    unit = gwy.objects.GwySIUnit(unitstr="m")
    scale = 1.0 if data.dtype == bool else METRES_PER_MM
    return gwy.objects.GwyDataField(
        scale * data.astype(np.float64),
        xreal=METRES_PER_MM * pixel * columns,
        yreal=METRES_PER_MM * pixel * rows,
        si_unit_xy=unit,
        si_unit_z=unit,
    )


def write_gsf(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Gwyddion's simple field: 32-bit floats, NaN where unknown; it has room for no error."""
    rows, columns = height.shape
    sizes = {"XReal": METRES_PER_MM * pixel * columns, "YReal": METRES_PER_MM * pixel * rows}
    about = {**sizes, "XYUnits": "m", "ZUnits": "m", "Title": "Height"}
    _package("gsf").write_gsf(file, (METRES_PER_MM * height).astype(np.float32), about)


def _read(kind: str, file: Path) -> MetrologyFile:
    package = _package(kind)
    try:
        width, length, *maps = _KIND_READERS[kind](package, file)
    except InputError:
        raise
    # A damaged file can raise any exception.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file}: cannot be read as a .{kind} file: {reason}") from None
    in_mm = ((np.asarray(one) / METRES_PER_MM).astype(np.float32) for one in maps)
    return MetrologyFile(width / METRES_PER_MM, length / METRES_PER_MM, *in_mm)


def _x3p(package: Any, file: Path) -> Sequence[Any]:
    """The first layer; the second is its error where this software wrote it."""
    read = package.read(file)
    layers = read.layers
    if not layers or np.asarray(getattr(layers[0], "z", 0)).ndim != 2:
        raise InputError(f"{file}: holds no surface, but a profile or points")
    known = 2 if read.metadata and read.metadata.instrument.model == SOFTWARE_NAME else 1
    return *layers[0].spacing, *(one.z for one in layers[:known])


def _gwy(gwy: Any, file: Path) -> Sequence[Any]:
    """The first channel, and the one that is called its error.

    The file is as long as it says: gwyfile never ends at a string cut off.
    """
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
    return width, length, *(_known(container, number, file) for number in numbers[:2])


def _known(container: Any, number: int, file: Path) -> Any:
    """A channel, NaN where it is masked."""
    field, mask = container[f"/{number}/data"], container.get(f"/{number}/mask")
    if any(unit is None or unit.unitstr != "m" for unit in (field.si_unit_xy, field.si_unit_z)):
        raise InputError(f"{file}: {NOT_METRES}")
    return field.data if mask is None else np.where(np.asarray(mask.data) > 0, np.nan, field.data)


def _gsf(package: Any, file: Path) -> Sequence[Any]:
    data, about = package.read_gsf(file)
    if about.get("ZUnits", "m") != "m" or about.get("XYUnits", "m") != "m":
        raise InputError(f"{file}: {NOT_METRES}")
    width, length = (float(about.get(key, math.nan)) for key in ("XReal", "YReal"))
    return width / data.shape[1], length / data.shape[0], data


def _package(kind: str) -> Any:
    need("metrology", f"a .{kind} file", _KIND_PACKAGES[kind])
    return importlib.import_module(_KIND_PACKAGES[kind])


METROLOGY_WRITERS = {"x3p": write_x3p, "gwy": write_gwy, "gsf": write_gsf}
_KIND_READERS = {"x3p": _x3p, "gwy": _gwy, "gsf": _gsf}
METROLOGY_READERS = {f".{kind}": partial(_read, kind) for kind in _KIND_READERS}
