"""The file of a calibration: arrays with units, a version, and provenance."""

import json
import zipfile
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, Provenance, warn
from tactograph.graph.declare.ports import record_ports, record_values
from tactograph.graph.disk.array_files import load_arrays
from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.disk.file_identity import ABOUT_ARRAY, about_in
from tactograph.graph.errors import missing, one_line
from tactograph.graph.rings import bring
from tactograph.nodes.files.sensor_identity import SensorIdentity
from tactograph.nodes.optics.lens import camera_offset
from tactograph.nodes.stored import Value, stored_values, with_plain

MIN_FLAT_LIGHT = 1e-3
"""Smallest 99th percentile of a flat frame, as a fraction of full scale."""
MIN_FILM_SHARE = 0.01
"""Share of a frame that must show film."""
MAX_LENS_SHIFT = 0.5
"""Share of the image's half diagonal by which a lens may move a point of the border."""
COLOUR_LIGHTS = ("bgr", "rgb")
"""The orders of lights that are the channels of a colour image."""


def _fits(arrays: Mapping[str, NDArray[Any]]) -> None:
    """The check of a kind whose arrays have no common condition."""


class FileKind(NamedTuple):
    """A kind of calibration: its name, version, the command that makes it, and its record.

    The operations on a kind are in a module of its name, ``calibrations/NAME_kind.py``
    (`nodes.calibrate.kinds`).  The file keeps the fields of `record` that are `Stored`.  Every kind
    holds a `pixel_size`, and all but a camera's a `flat`.  `sources` lists the causes to check if a
    calibration fails without a doubt, `users` the graphs that take it.  `check` raises a
    `ValueError` if the arrays, each valid by itself, cannot be of one sensor.
    """

    name: str
    format: int
    maker: str
    record: type
    sources: str
    users: str
    check: Callable[[Mapping[str, NDArray[Any]]], None] = _fits

    @property
    def values(self) -> Mapping[str, Value]:
        return stored_values(self.record)

    def new_file(self, file: Path) -> Path:
        """Return the path of a new calibration, if it is free or of an earlier one of this kind.

        For ``AfterValidator``: a wrong name is refused before the work starts.

        Raises
        ------
        ValueError
            If its name is wrong, or that of an existing file of another kind.
        """
        if file.suffix != ".npz":
            raise ValueError("a calibration file is called something.npz")
        try:
            is_free = not file.exists() or self._is_in(about_in(_load(file, self.maker)))
        except InputError:
            is_free = False
        if not is_free:
            raise ValueError(f"the name of a new file, or of an earlier {self.name}, is needed")
        return file

    def write(self, file: Path, values: Mapping[str, Any]) -> None:
        """Write a calibration as one ``.npz``, atomically, readable without pickle.

        Parameters
        ----------
        values
            The arrays of this kind (an absent one has the value of a plain sensor), and further
            data to store as JSON; a `Provenance` is stored as its dictionary.  The date is added.

        Raises
        ------
        InputError
            If `read` would refuse the file, which is then not written, or it cannot be written.
        """
        about = {name: value for name, value in values.items() if name not in self.values}
        head = {
            "format": self.format,
            "kind": f"tactograph {self.name}",
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "units": {name: value.port.meaning for name, value in self.values.items()},
            **{n: v.as_dict() if isinstance(v, Provenance) else v for n, v in about.items()},
        }
        stated = {n: values[n] for n in self.values if values.get(n) is not None}
        filled = with_plain(self.record, stated)
        with np.errstate(over="ignore"):  # too large for float32: infinite, and refused
            typed: dict[str, Any] = {
                n: np.asarray(filled[n], value.dtype) for n, value in self.values.items()
            }
        advice, *_ = values.get("doubts") or [f"check {self.sources}"]
        self._check(file, typed, "the calibration failed and is not written", advice)
        _write_archive(file, {ABOUT_ARRAY: np.array(json.dumps(head)), **typed})

    def write_record(self, file: Path, record: Any, about: Mapping[str, Any]) -> None:
        """Write a record of this kind as `write` does, with further entries of the header."""
        values = record_values(self.record, record)
        self.write(file, {**dict(zip(record_ports(self.record), values, strict=True)), **about})

    def replace(self, file: Path, arrays: Mapping[str, Any]) -> None:
        """Replace some arrays of a calibration's file and keep the rest.

        Raises
        ------
        InputError
            As `read`, or if the file cannot be written.
        """
        typed = {n: np.asarray(array, self.values[n].dtype) for n, array in arrays.items()}
        every = self.stored(file) | typed
        self._check(file, every, "stays as it was", f"check {self.sources}")
        _write_archive(file, every)

    def read(self, file: Path) -> tuple[dict[str, Any], "About"]:
        """Return a calibration's arrays, those without axes as floats, and its header.

        Raises
        ------
        InputError
            If the file is missing, damaged, of another kind or version, or holds a pickle; if an
            array is missing, empty, misshapen, not finite or out of range; if the film is dark
            under an LED; if the arrays cannot be of one sensor; if the header's figures are not
            numbers by name, or its doubts not sentences.
        """
        arrays = self.stored(file)
        self._check(file, arrays, "not as this version writes it", "calibrate again")
        values = self.values.items()
        typed = {n: arrays[n] if v.port.dims else float(arrays[n]) for n, v in values}
        return typed, _about(file, about_in(arrays))

    def stored(self, file: Path) -> dict[str, NDArray[Any]]:
        """Return all arrays of a file by name, of which only kind and version are checked."""
        arrays = _load(file, self.maker)
        _check_head(file, self, about_in(arrays))
        return arrays

    @classmethod
    def named(cls, name: str) -> Self:
        """Return the kind of this name.  Raises InputError if no installed ring brings it."""
        module: Any = _module(name)
        if module is None:
            raise InputError(f"no installed ring knows the files of a {name}")
        kind: Self = module.KIND
        return kind

    @staticmethod
    def module_of(file: Path) -> ModuleType | None:
        """Import the module of the kind that a file claims to be; None if there is none.

        Raises
        ------
        InputError
            If there is no such file, or it is damaged.
        """
        name = about_in(_load(file, "run calibrate", ABOUT_ARRAY)).get("kind")
        return _module(str(name).removeprefix("tactograph "))

    @staticmethod
    def read_sensor(file: Path) -> Any:
        """Return the record of a calibration of any kind of sensor: flashed LEDs, or one-shot.

        Raises
        ------
        InputError
            If it is none, or damaged.
        """
        module: Any = FileKind.module_of(file)
        if module is None or "flat" not in module.KIND.values:
            module = _module("calibration")
        return module.read(file)

    def read_to_use(self, file: Path, lights: str | None = None) -> tuple[dict[str, Any], "About"]:
        """Return what `read` does, repeat all doubts in one warning, and refuse other lights.

        Parameters
        ----------
        lights : layout of the lights in the images to measure; None if unknown

        Raises
        ------
        InputError
            As `read`; if it was made from "bgr" and is used for "rgb", or the reverse.
        """
        arrays, about = self.read(file)
        if about.doubts:
            more = len(about.doubts) - 1
            others = f" (and {more} more doubt{'s' if more > 1 else ''})" if more else ""
            warn(
                f"calibration {file} is doubtful: {about.doubts[0]}{others}; see "
                f"'tactograph show {file}'"
            )
        if lights not in COLOUR_LIGHTS:
            return arrays, about
        if about.lights in COLOUR_LIGHTS and about.lights != lights:
            raise InputError(
                f"{file}: was made of colours in the order {about.lights}, not {lights}; give "
                f"`lights`={about.lights}, or calibrate with {lights}"
            )
        if about.lights is None and lights == "rgb":
            warn(
                f"{file}: does not say whether it was made of colours in the order rgb; calibrate "
                "again"
            )
        return arrays, about

    def _check(self, file: Path, arrays: Mapping[str, NDArray[Any]], what: str, cure: str) -> None:
        """Refuse arrays that are not as declared, with the reason."""
        try:
            _check_arrays(self, arrays)
        except ValueError as error:
            raise InputError(f"{file}: {what}: {error}; {cure}") from None

    def _is_in(self, head: Mapping[str, Any]) -> bool:
        """Whether a file of that header claims to be a calibration of this kind."""
        return bool(head.get("kind") == f"tactograph {self.name}")


def _module(kind: str) -> ModuleType | None:
    return bring("calibrations", f"{kind.replace(' ', '_')}_kind")


class About(NamedTuple):
    """Header of a calibration.

    `quality` holds its figures, `doubts` the findings against it, a sentence each.  `lights` is the
    layout of the lights in its images, as for `read_capture`; None if unknown.  `serial` is the
    camera's serial number, if it has one.  `head` is the header as stored in the file.
    """

    quality: dict[str, float]
    doubts: list[str]
    lights: str | None
    serial: str | None
    head: Mapping[str, Any]


def _about(file: Path, head: Mapping[str, Any]) -> About:
    """Read a header, which may lack entries."""
    quality, doubts = head.get("quality", {}), head.get("doubts", [])
    if not isinstance(quality, dict) or not all(_is_number(v) for v in quality.values()):
        raise InputError(f"{file}: 'quality' is not a list of figures; calibrate again")
    if not isinstance(doubts, list) or not all(isinstance(d, str) for d in doubts):
        raise InputError(f"{file}: 'doubts' is not a list of sentences; calibrate again")
    lights: Any = head
    for name in ("provenance", "arguments", "lights"):
        lights = lights.get(name) if isinstance(lights, dict) else None
    figures = {name: float(value) for name, value in quality.items()}
    sentences = [one_line(doubt) for doubt in doubts]
    serial = SensorIdentity.stated_in(head).serial or None
    return About(figures, sentences, lights if isinstance(lights, str) else None, serial, head)


def _write_archive(file: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    with (
        atomic_file(file) as target,
        # Higher levels take twice as long on images, which hardly become smaller.
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)


def _is_number(value: object) -> bool:
    # An integer may have more digits than a float can hold.
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63)


def _load(file: Path, maker: str, only: str | None = None) -> dict[str, NDArray[Any]]:
    if not file.is_file():
        maker = f"'{maker}' makes one"
        if file.is_dir():
            raise InputError(f"{file}: is a folder, and no calibration file; {maker}")
        raise InputError(missing(file, f"calibration file ({maker})"))
    try:
        return load_arrays(file, only)
    except (OSError, ValueError) as error:
        damage = getattr(error, "strerror", None) or f"damaged, or no .npz: {error}"
        why = "it holds a pickle" if "pickle" in str(error) else damage
        raise InputError(f"{file}: this calibration cannot be used: {why}") from None


def _check_head(file: Path, kind: FileKind, head: Mapping[str, Any]) -> None:
    name, version = head.get("kind"), head.get("format")
    if not isinstance(name, str):
        raise InputError(f"{file}: not a {kind.name}; '{kind.maker}' makes one")
    if not kind._is_in(head):
        other_kind = name.removeprefix("tactograph ")
        other = FileKind.module_of(file)
        users = f"; a {other_kind} is for {other.KIND.users}" if other else ""
        raise InputError(
            f"{file}: is a {other_kind}, not a {kind.name}; '{kind.maker}' makes one{users}"
        )
    if not isinstance(version, int):
        raise InputError(f"{file}: 'format' is not a whole number; calibrate again")
    if version != kind.format:
        raise InputError(
            f"{file}: {kind.name} format {version}, but this version reads {kind.format}; "
            "calibrate again"
        )


def _check_arrays(kind: FileKind, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise a `ValueError` that names an array that is not as declared, with the reason."""
    sizes: dict[str, int] = {}
    for name, value in kind.values.items():
        if name not in arrays:
            raise ValueError(f"'{name}' is missing")
        _check_array(name, arrays[name], value, sizes)
    if "flat" in kind.values:
        _check_flat(arrays)
    _check_lens(arrays["lens"])
    kind.check(arrays)


def _check_flat(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise a `ValueError` if the flat frame shows too little film, or is dark."""
    flat, area = arrays["flat"], arrays["area"] > 0
    if area.mean() < MIN_FILM_SHARE:
        raise ValueError(f"'area' shows film at {area.sum()} of {area.size} pixels")
    if (led := dark_led(flat)) is not None:
        raise ValueError(f"'flat' is dark under LED {led}")


def _check_lens(lens: NDArray[Any]) -> None:
    """Raise a `ValueError` if the lens moves the border of an image by too much."""
    along = np.linspace(-1, 1, 17)
    border = [(x, y) for x in along for y in (-1, 1)] + [(x, y) for x in (-1, 1) for y in along]
    u, v = np.array(border).T / np.sqrt(2)
    shift = float(np.hypot(*camera_offset(lens.astype(np.float64), u, v)).max())
    if not shift < MAX_LENS_SHIFT:
        raise ValueError(
            f"'lens' moves what lies at the border by {shift:.0%} of half the diagonal"
        )


def dark_led(flat: NDArray[Any]) -> int | None:
    """Return the first LED, counted from 1, whose flat frame (K x H x W) is dark."""
    numbered = enumerate(flat, start=1)
    return next(
        (k for k, plane in numbered if float(np.percentile(plane, 99)) < MIN_FLAT_LIGHT), None
    )


def _check_array(name: str, array: NDArray[Any], value: Value, sizes: dict[str, int]) -> None:
    """Check one array; `sizes` collects the letters' sizes."""
    axes, stored = value.port.dims, value.stored
    if array.dtype != value.dtype or array.ndim != len(axes):
        raise ValueError(
            f"'{name}' is {array.dtype} of shape {array.shape}, not "
            f"{value.dtype} of {len(axes)} axes"
        )
    if not array.size:
        raise ValueError(f"'{name}' is empty, of shape {array.shape}")
    due = tuple(
        axis if isinstance(axis, int) else sizes.setdefault(axis, size)
        for axis, size in zip(axes, array.shape, strict=True)
    )
    if array.shape != due:
        raise ValueError(f"'{name}' has shape {array.shape}, not {due}")
    if not np.isfinite(array).all():
        raise ValueError(f"'{name}' holds NaN or infinite values")
    outside = array[(array < stored.low) | (array > stored.high)]
    if outside.size:
        raise ValueError(
            f"'{name}' holds {outside[0]:g}, which no sensor has "
            f"({stored.low:g} to {stored.high:g})"
        )
