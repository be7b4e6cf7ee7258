"""The file of a calibration: arrays with units, a version, and provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from tactograph.graph import InputError, Provenance
from tactograph.graph.files.array_files import load_arrays
from tactograph.graph.files.whole_files import whole_file

DARKEST = 1e-3
"""Smallest 99th percentile of a flat frame, as a fraction of full scale."""


USERS = {
    "calibration": "sensors whose LEDs flash: reconstruct, precise, recalibrate, check_calibration",
    "press calibration": "one-shot sensors: gelsight_mini, recalibrate_oneshot",
    "camera": "lens=",
}
"""Users of each kind of file."""


class Stored(NamedTuple):
    """An array of the file: its axes (sizes by letter or number), unit, type and range.

    Older files may lack an array that is not `required`.  `low` and `high` bound the values of
    any sensor: beyond them a file is damaged, not unusual.
    """

    axes: str
    unit: str
    dtype: type[np.generic] = np.float32
    required: bool = True
    low: float = -np.inf
    high: float = np.inf


class FileKind(NamedTuple):
    """A kind of calibration: its name, version, the command that makes it, and its arrays.

    Every kind holds a `pixel_size`, and all but a camera's a `flat`.
    """

    name: str
    format: int
    maker: str
    arrays: Mapping[str, Stored]


def _npz(file: Path) -> Path:
    if file.suffix != ".npz":
        raise ValueError("a calibration file is called something.npz")
    return file


NewFile = Annotated[Path, AfterValidator(_npz)]
"""Path of a new calibration; a wrong name is refused before the work starts."""


def write_arrays(
    file: Path, kind: FileKind, arrays: Mapping[str, Any], about: Mapping[str, Any]
) -> None:
    """Write a calibration as one ``.npz``, replaced as a whole, readable without pickle.

    Parameters
    ----------
    arrays
        All those of `kind`.
    about
        Further data to store as JSON; a `Provenance` is stored as its dictionary.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    head = {
        "format": kind.format,
        "kind": f"tactograph {kind.name}",
        "units": {name: stored.unit for name, stored in kind.arrays.items()},
        **{n: v.as_dict() if isinstance(v, Provenance) else v for n, v in about.items()},
    }
    typed: dict[str, Any] = {
        name: stored.dtype(arrays[name]) for name, stored in kind.arrays.items()
    }
    with whole_file(file) as target:
        np.savez_compressed(target, about=np.array(json.dumps(head)), **typed)


def read_arrays(file: Path, kind: FileKind) -> dict[str, Any]:
    """Return the arrays of a calibration, without pickle; those without axes as floats.

    An older file may lack those that are not required.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind or version, or holds a pickle; if an
        array is missing, misshapen, not finite or out of range; if the film is dark under an
        LED.
    """
    arrays = _load(file, kind)
    _check_head(file, kind, arrays)
    sizes: dict[str, int] = {}
    kept = {n: stored for n, stored in kind.arrays.items() if stored.required or n in arrays}
    for name, stored in kept.items():
        _check_array(file, kind, name, arrays.get(name), stored, sizes)
    found = {n: arrays[n] if stored.axes else float(arrays[n]) for n, stored in kept.items()}
    for k, plane in enumerate(arrays["flat"] if "flat" in kept else (), start=1):
        if float(np.percentile(plane, 99)) < DARKEST:
            raise InputError(f"{file}: 'flat' is dark under LED {k}; calibrate again")
    return found


def read_quality(file: Path) -> dict[str, float]:
    """Return the quality figures stored with a calibration; empty if there are none.

    `read_arrays` must have read the file before.
    """
    quality = json.loads(str(load_arrays(file)["about"])).get("quality", {})
    return {name: float(value) for name, value in quality.items()}


def is_of_kind(file: Path, kind: FileKind) -> bool:
    """Whether a file claims to be a calibration of this kind; it may still be damaged.

    Raises
    ------
    InputError
        If there is no such file, or it holds no arrays.
    """
    try:
        name = json.loads(str(_load(file, kind)["about"]))["kind"]
    except (KeyError, ValueError, TypeError):
        return False
    return bool(name == f"tactograph {kind.name}")


def _load(file: Path, kind: FileKind) -> dict[str, NDArray[Any]]:
    if not file.is_file():
        raise InputError(f"{file}: there is no such calibration file; '{kind.maker}' makes one")
    try:
        return load_arrays(file)
    except (OSError, ValueError) as error:
        why = "it holds a pickle" if "pickle" in str(error) else f"it is damaged: {error}"
        raise InputError(f"{file}: the calibration is refused: {why}") from None


def _check_head(file: Path, kind: FileKind, arrays: Mapping[str, NDArray[Any]]) -> None:
    try:
        head = json.loads(str(arrays["about"]))
        name, version = head["kind"], head["format"]
    except (KeyError, ValueError, TypeError):
        raise InputError(f"{file}: not a {kind.name}; '{kind.maker}' makes one") from None
    if name != f"tactograph {kind.name}":
        found = str(name).removeprefix("tactograph ")
        users = f"; a {found} is for {USERS[found]}" if found in USERS else ""
        raise InputError(
            f"{file}: is a {found}, not a {kind.name}; '{kind.maker}' makes one{users}"
        )
    if version != kind.format:
        raise InputError(
            f"{file}: {kind.name} format {version}, but this version reads {kind.format}; "
            "calibrate again"
        )


def _check_array(
    file: Path,
    kind: FileKind,
    name: str,
    array: NDArray[Any] | None,
    stored: Stored,
    sizes: dict[str, int],
) -> None:
    """Refuse an array that is not as declared; `sizes` collects the letters' sizes."""
    if array is None:
        raise InputError(
            f"{file}: the calibration is incomplete: '{name}' is missing; "
            f"'{kind.maker}' makes a whole one"
        )
    axes = stored.axes.split()
    if array.dtype != stored.dtype or array.ndim != len(axes):
        raise InputError(
            f"{file}: '{name}' is {array.dtype} of shape {array.shape}, not "
            f"{np.dtype(stored.dtype)} of {len(axes)} axes; calibrate again"
        )
    wanted = tuple(
        int(axis) if axis.isdigit() else sizes.setdefault(axis, size)
        for axis, size in zip(axes, array.shape, strict=True)
    )
    if array.shape != wanted:
        raise InputError(f"{file}: '{name}' has shape {array.shape}, not {wanted}; calibrate again")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: '{name}' holds NaN or infinite values; calibrate again")
    outside = array[(array < stored.low) | (array > stored.high)]
    if outside.size:
        raise InputError(
            f"{file}: '{name}' holds {outside[0]:g}, which no sensor has "
            f"({stored.low:g} to {stored.high:g}); calibrate again"
        )
