"""ISO 25178-72: 64-bit floats, NaN where unknown; the error is a second layer."""

import io
import re
import zipfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import milli

from tactograph.rings.metrology.formats._in_metres import package_for, read_in_metres
from tactograph.sdk import Height, HeightError, HeightFile, InputError, warn

MAIN_FILE, DRAFT_ROOT = "main.xml", "ISO5436"
ROOT_TAG = re.compile(rb"(</?(?:[\w.-]+:)?ISO5436)(?=[\s>])")
"""Begin and end of a root that lacks the part's number."""
SOFTWARE_NAME = "Tactograph"
"""What files name as their writer, and whose second layer is an error."""


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm, and their standard deviation if it is known."""
    layers = [height] if error is None else [height, error]
    data = milli * np.stack(layers).astype(np.float64)
    package, side = package_for("x3p", "x3pio"), milli * pixel
    about = package.Metadata.for_software(SOFTWARE_NAME, version("tactograph"))
    package.write(file, data, x_scale=side, y_scale=side, metadata=about)


def read(file: Path) -> HeightFile:
    """Read the first layer; the second is its error where this software wrote it."""
    return read_in_metres(file, _layers)


def _layers(file: Path) -> Sequence[Any]:
    content = _read(file)
    layers = content.layers
    if not layers or np.asarray(getattr(layers[0], "z", 0)).ndim != 2:
        raise InputError(f"{file}: holds no surface, but a profile or points")
    count = 2 if content.metadata and content.metadata.instrument.model == SOFTWARE_NAME else 1
    return *layers[0].spacing, *(one.z for one in layers[:count])


def _read(file: Path) -> Any:
    """The content; a stale checksum and a draft's root cause a warning, and are read."""
    package = package_for("x3p", "x3pio")
    try:
        return package.read(file)
    except package.X3pChecksumError:
        warn(f"{file}: was changed since its checksum was made; read as it is")
    except package.X3pFormatError as error:
        if f"<{DRAFT_ROOT}>" not in str(error):
            raise
        warn(f"{file}: its root is {DRAFT_ROOT}, not ISO 25178-72's; read as if it were")
    return package.X3pFile.loads(_with_root(file), verify=False)


def _with_root(file: Path) -> bytes:
    """The file's content, the root element named as the standard does."""
    renamed = io.BytesIO()
    with zipfile.ZipFile(file) as archive, zipfile.ZipFile(renamed, "w") as target:
        for member in archive.infolist():
            content = archive.read(member)
            if Path(member.filename).name == MAIN_FILE:
                content = ROOT_TAG.sub(rb"\1_2", content)
            target.writestr(member.filename, content)
    return renamed.getvalue()
