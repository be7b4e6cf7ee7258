"""Read a calibration, and refuse anything that is not a whole one."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, Port, node
from tactograph.nodes import (
    F4,
    Dark,
    Light,
    LightPositions,
    LutLight,
    LutLit,
    LutSlope,
    Noise,
    NullVector,
    PixelSize,
    Reflectance,
    Spread,
)
from tactograph.nodes.write_calibration import FORMAT


class Calibration(NamedTuple):
    """What `write_calibration` wrote."""

    flat: Light
    dark: Dark
    pixel_size: PixelSize
    lut_light: LutLight
    lut_slope: LutSlope
    lut_lit: LutLit
    reflectance: Reflectance
    residual: Annotated[F4, Port("K", "1")]
    null: NullVector
    spread: Spread
    lights: LightPositions
    noise: Noise


_SHAPES = {
    "flat": "K H W",
    "dark": "H W",
    "pixel_size": "",
    "lut_light": "N K",
    "lut_slope": "N 2",
    "lut_lit": "N",
    "reflectance": "K 9",
    "residual": "K",
    "null": "K",
    "spread": "",
    "lights": "K 3",
    "noise": "2",
}


@node
def read_calibration(*, file: Path) -> Calibration:
    """Read the ``.npz`` that `write_calibration` wrote, without pickle.

    Parameters
    ----------
    file
        The calibration.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another version, holds a pickle, or an array
        that is missing, misshapen, or not finite.
    """
    arrays = _load(file)
    _check_about(file, arrays)
    sizes: dict[str, int] = {}
    for name, dims in _SHAPES.items():
        _check_array(file, name, arrays.get(name), dims.split(), sizes)
    found: dict[str, Any] = {name: arrays[name] for name in _SHAPES}
    found["pixel_size"] = float(found["pixel_size"])
    found["spread"] = float(found["spread"])
    if found["pixel_size"] <= 0:
        raise InputError(f"{file}: the pixel size {found['pixel_size']} is not positive")
    if (found["lights"][:, 2] <= 0).any():
        raise InputError(f"{file}: 'lights' holds an LED that is not above the film")
    return Calibration(**found)


def _load(file: Path) -> dict[str, NDArray[Any]]:
    if not file.is_file():
        raise InputError(f"{file}: there is no such calibration file; 'run calibrate' makes one")
    try:
        with np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (OSError, EOFError, zipfile.BadZipFile, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{file}: the calibration is damaged: {error}") from None
    except ValueError as error:
        why = "it holds a pickle" if "pickle" in str(error) else f"it is damaged: {error}"
        raise InputError(f"{file}: the calibration is refused: {why}") from None
    except Exception as error:  # a damaged archive fails anywhere inside zipfile and zlib
        raise InputError(f"{file}: the calibration is damaged: {error}") from None


def _check_about(file: Path, arrays: dict[str, NDArray[Any]]) -> None:
    try:
        about = json.loads(str(arrays["about"]))
        kind, version = about["kind"], about["format"]
    except (KeyError, ValueError, TypeError):
        raise InputError(f"{file}: not a calibration; 'run calibrate' makes one") from None
    if kind != "tactograph calibration":
        raise InputError(f"{file}: is a {kind}, not a calibration")
    if version != FORMAT:
        raise InputError(
            f"{file}: calibration format {version}, but this version reads {FORMAT}; "
            "calibrate again"
        )


def _check_array(
    file: Path, name: str, array: NDArray[Any] | None, dims: list[str], sizes: dict[str, int]
) -> None:
    if array is None:
        raise InputError(f"{file}: the calibration is incomplete: '{name}' is missing")
    dtype = np.uint8 if name == "lut_lit" else np.float32
    if array.dtype != dtype or array.ndim != len(dims):
        raise InputError(f"{file}: '{name}' is {array.dtype} of shape {array.shape}")
    for dim, size in zip(dims, array.shape, strict=True):
        if sizes.setdefault(dim, int(dim) if dim.isdigit() else size) != size:
            raise InputError(f"{file}: '{name}' has shape {array.shape}; {dim} is {sizes[dim]}")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: '{name}' holds NaN or infinite values")
