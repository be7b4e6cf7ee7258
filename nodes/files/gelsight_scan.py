"""Scans and light models as GelSight's software stores them: ``scan.yaml`` and a model beside it.

That software writes YAML by hand: keys without a value (``fov:      : 5``), Windows' paths,
sizes as ``[a, b]`` or ``(a, b)``, text in the encoding of Windows.  A scan lists its images in the
order of the LEDs.
"""

import contextlib
import math
import re
from pathlib import Path, PureWindowsPath
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph import InputError
from tactograph.graph.disk.strict_yaml import parse_yaml
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import MAX_PIXEL_MM, MIN_PIXEL_MM
from tactograph.nodes.files.image_files import MAX_PIXELS

SCAN_FILE = "scan.yaml"
MAX_BYTES = 1_000_000
MAX_LEDS = 8
LIGHT_TERMS = 10
"""Terms of the light model per LED: a00, a01, a02, a11, a12, a22, b0, b1, b2, c."""
DEGREE_BY_ROWS = {1: 0, 3: 1, 6: 2, 10: 3, 15: 4}
"""Rows of a matrix, and the degree in the position that they stand for; the highest degree
comes first, within a degree falling in u."""
_DOUBLE_COLON = re.compile(r"^(\s*[A-Za-z_]\w*\s*:)\s+:\s*", re.MULTILINE)


class Circle(NamedTuple):
    """A ball that was marked by hand: its place in the grid, its centre and radius in px."""

    column: int
    row: int
    x: float
    y: float
    radius: float


class Scan(NamedTuple):
    """Contents of a ``scan.yaml``."""

    images: list[Path]
    pixel_size: float
    """mm per px; 0 where it is unknown."""
    model: str
    """The light model's file name, without its folder; empty where none is named."""
    circles: list[Circle]
    ball_radius: float
    """mm; 0 where it is unknown."""


class FlatField(NamedTuple):
    """Flat frames of all LEDs in one image, three tiles a row, and the scale of each."""

    image: Path
    scale: list[float]


class LightModelFile(NamedTuple):
    """The light of K LEDs as functions of normal and position; matrices as they are stored."""

    width: int
    height: int
    pixel_size: float
    linear: F4
    """R x K m: m is 3, or 4 with a scale."""
    quadratic: F4
    """R x K m: m is 10, or 11 with a scale."""
    leds: int
    black: list[float]
    """Light in the shadow of each LED."""
    flat: FlatField | None


def is_scan(folder: Path) -> bool:
    """Return whether a folder is a scan."""
    return (folder / SCAN_FILE).is_file()


def read_scan(folder: Path) -> Scan:
    """Read a scan's file.

    Raises
    ------
    InputError
        If it cannot be read, lists no images or files outside the folder, or is cropped.
    """
    file = folder / SCAN_FILE
    entries = _entries(file)
    images = [_image(folder, name, file) for name in _list(entries, "images", file)]
    if not images:
        raise InputError(f"{file}: images: names no file")
    if len(set(images)) < len(images):
        raise InputError(f"{file}: images: names a file twice")
    if any(_numbers(entries.get("crop", []), f"{file}: crop")):
        raise InputError(
            f"{file}: crop: what it counts from is not known; set it to [0, 0, 0, 0] and crop by "
            "crop=x0,y0,x1,y1"
        )
    pixel = _number(entries.get("mmperpixel", 0), f"{file}: mmperpixel")
    if pixel and not MIN_PIXEL_MM <= pixel <= MAX_PIXEL_MM:
        raise InputError(f"{file}: mmperpixel: {pixel:g} is no size of a pixel in mm")
    target = entries.get("target")
    of_target = target.get("radius", 0) if isinstance(target, dict) else 0
    radius = _number(entries.get("calibradius", of_target), f"{file}: radius of the balls")
    if not 0 <= radius < 1e3:
        raise InputError(f"{file}: {radius:g} is no radius of a ball in mm")
    noted = _list(entries, "annotations", file) if entries.get("annotations") else []
    marks = [_circle(mark, file) for mark in noted]
    model = PureWindowsPath(str(entries.get("calib") or "")).name
    return Scan(images, pixel, model, [mark for mark in marks if mark is not None], radius)


def find_light_model(folder: Path) -> Path:
    """The light model that a scan names, in its folder or the one above.

    Raises
    ------
    InputError
        If it names none, or none is there.
    """
    name = read_scan(folder).model
    if not name:
        raise InputError(f"{folder / SCAN_FILE}: names no light model; give it as model=FILE.yaml")
    for place in (folder / name, folder.parent / name):
        with contextlib.suppress(OSError):  # of a name that is too long
            if place.is_file():
                return place
    raise InputError(f"{folder}: its light model {name} is not there; give it as model=FILE.yaml")


def read_light_model_file(file: Path) -> LightModelFile:
    """Read a light model.

    Raises
    ------
    InputError
        If it cannot be read, or a matrix does not have the size that LEDs and terms demand.
    """
    entries = _entries(file)
    if "images" in entries:
        raise InputError(f"{file}: is a scan; give its folder, or the light model that it names")
    leds = _count(entries.get("nL", 0), f"{file}: nL")
    if not 3 <= leds <= MAX_LEDS:
        raise InputError(f"{file}: nL: has {leds} LEDs; a slope needs from 3 to {MAX_LEDS}")
    width, height = (_count(entries.get(k, 0), f"{file}: {k}") for k in ("width", "height"))
    pixel = _number(entries.get("mmperpixel", 0), f"{file}: mmperpixel")
    if min(width, height) < 1 or not MIN_PIXEL_MM <= pixel <= MAX_PIXEL_MM:
        raise InputError(f"{file}: width, height and mmperpixel must be above 0")
    if width * height > MAX_PIXELS:
        raise InputError(f"{file}: {width} x {height} px are no frame of a camera")
    black = _per_led(entries.get("black", [0.0] * leds), leds, f"{file}: black")
    if not all(0 <= light < 1 for light in black):
        raise InputError(f"{file}: black: a share of full scale is needed, from 0 to 1")
    return LightModelFile(
        width,
        height,
        pixel,
        _matrix(entries, "linfit", leds, 3, file),
        _matrix(entries, "quadfit", leds, LIGHT_TERMS, file),
        leds,
        black,
        _flat_field(entries.get("flatfield"), leds, file),
    )


def _entries(file: Path) -> dict[str, Any]:
    """The file's entries, its software's slips mended."""
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from None
    if len(raw) > MAX_BYTES:
        raise InputError(f"{file}: is larger than {MAX_BYTES // 1000} kB; no scan or light model")
    text = _text(raw, file)
    if not text.strip():
        raise InputError(f"{file}: the file is empty")
    entries = parse_yaml(_DOUBLE_COLON.sub(r"\1 ", text), str(file)).data
    if not isinstance(entries, dict):
        raise InputError(f"{file}: holds no entries such as 'images:' or 'quadfit:'")
    return entries


def _text(raw: bytes, file: Path) -> str:
    for encoding in ("utf-8-sig", "cp1252"):
        with contextlib.suppress(UnicodeDecodeError):
            if b"\0" not in raw:
                return raw.decode(encoding)
    raise InputError(f"{file}: is not a text file")


def _list(entries: dict[str, Any], key: str, file: Path) -> list[Any]:
    value = entries.get(key)
    if not isinstance(value, list):
        raise InputError(f"{file}: {key}: a list is needed")
    return value


def _image(folder: Path, name: Any, file: Path) -> Path:
    plain = PureWindowsPath(str(name)).name
    if plain != str(name):
        raise InputError(f"{file}: images: '{name}' must be the name of a file beside {SCAN_FILE}")
    return folder / plain


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where}: '{value}' is not a number")
    return float(value)


def _count(value: Any, where: str) -> int:
    number = _number(value, where)
    if number != int(number):
        raise InputError(f"{where}: {value} is not a whole number")
    return int(number)


def _numbers(value: Any, where: str) -> list[float]:
    if not isinstance(value, list):
        raise InputError(f"{where}: a list of numbers is needed")
    return [_number(one, where) for one in value]


def _circle(mark: Any, file: Path) -> Circle | None:
    """A marked ball; None for other marks."""
    if not isinstance(mark, dict) or mark.get("type") != "GridCircle":
        return None
    keys = "gx", "gy", "x", "y", "r"
    column, row, *place = (_number(mark.get(k), f"{file}: annotations: {k}") for k in keys)
    return Circle(int(column), int(row), *place)


def _matrix(entries: dict[str, Any], key: str, leds: int, terms: int, file: Path) -> F4:
    """A matrix of `terms` columns per LED, or of one more."""
    entry = entries.get(key)
    if not isinstance(entry, dict):
        raise InputError(f"{file}: {key}: is missing; this is not a light model")
    rows, columns = (_count(entry.get(k), f"{file}: {key}: {k}") for k in ("rows", "cols"))
    values = _numbers(entry.get("values"), f"{file}: {key}: values")
    if rows not in DEGREE_BY_ROWS:
        known = ", ".join(map(str, DEGREE_BY_ROWS))
        raise InputError(f"{file}: {key}: has {rows} rows; positions of {known} rows are known")
    if columns not in (leds * terms, leds * (terms + 1)) or len(values) != rows * columns:
        raise InputError(
            f"{file}: {key}: {len(values)} values in {rows} rows of {columns} are not "
            f"{terms} or {terms + 1} for each of {leds} LEDs"
        )
    return np.array(values, np.float32).reshape(rows, columns)


def _per_led(value: Any, leds: int, where: str) -> list[float]:
    numbers = _numbers(value, where)
    if len(numbers) != leds:
        raise InputError(f"{where}: {len(numbers)} values for {leds} LEDs")
    return numbers


def _flat_field(entry: Any, leds: int, file: Path) -> FlatField | None:
    if entry is None:
        return None
    if not isinstance(entry, dict) or not isinstance(entry.get("modelfile"), str):
        raise InputError(f"{file}: flatfield: modelfile: the image's name is needed")
    scale = _per_led(entry.get("scale"), leds, f"{file}: flatfield: scale")
    if min(scale) <= 0:
        raise InputError(f"{file}: flatfield: scale: {min(scale):g} is not above 0")
    return FlatField(file.parent / PureWindowsPath(entry["modelfile"]).name, scale)
