"""Scans and light models as GelSight's software stores them: ``scan.yaml`` and a model beside it.

That software writes YAML by hand: keys without a value (``fov:      : 5``), Windows' paths,
sizes as ``[a, b]`` or ``(a, b)``, text in the encoding of Windows.  A scan lists its images in the
order of the LEDs.
"""

import contextlib
import re
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Interval, Len
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from tactograph.graph import InputError
from tactograph.graph.disk.strict_yaml import Entries, parse_yaml
from tactograph.nodes.files.height_files import MAX_PIXEL_MM, MIN_PIXEL_MM
from tactograph.nodes.files.image_files import MAX_PIXELS

SCAN_FILE = "scan.yaml"
MAX_BYTES = 1_000_000
LIGHT_TERMS = 10
"""Terms of the light model per LED: a00, a01, a02, a11, a12, a22, b0, b1, b2, c."""
DEGREE_BY_ROWS = {1: 0, 3: 1, 6: 2, 10: 3, 15: 4}
"""Rows of a matrix, and the degree in the position that they stand for; the highest degree
comes first, within a degree falling in u."""
PixelSide = Annotated[float, Interval(ge=MIN_PIXEL_MM, le=MAX_PIXEL_MM)]
BallRadius = Annotated[float, Interval(ge=0, lt=1e3)]
LedCount = Annotated[int, Interval(ge=3, le=8)]
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


class _Entries(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Mark(_Entries):
    gx: float
    gy: float
    x: float
    y: float
    r: float


def _ball(mark: Any) -> Any:
    """A mark of a scan, None if it is of another kind."""
    return mark if isinstance(mark, dict) and mark.get("type") == "GridCircle" else None


def _no_scan(_: Any) -> None:
    raise PydanticCustomError("scan", "is a scan; give its folder, or the model that it names")


class _Target(_Entries):
    radius: BallRadius = 0.0


class _ScanFile(_Entries):
    images: Annotated[list[str], Len(1)]
    crop: list[float] = []
    mmperpixel: Annotated[
        PixelSide | None, BeforeValidator(lambda size: None if size == 0 else size)
    ] = None
    calibradius: BallRadius | None = None
    target: Annotated[
        _Target | None, BeforeValidator(lambda said: said if isinstance(said, dict) else None)
    ] = None
    annotations: Annotated[
        list[Annotated[_Mark | None, BeforeValidator(_ball)]], BeforeValidator(lambda a: a or [])
    ] = []
    calib: Any = None


class Matrix(_Entries):
    """A matrix as it is stored, row by row."""

    rows: int
    cols: int
    values: list[float]


class FlatField(_Entries):
    """Flat frames of all LEDs in one image, three tiles a row, and the scale of each."""

    image: str = Field(alias="modelfile")
    scale: Annotated[list[Annotated[float, Gt(0)]], Len(1)]


class LightModelFile(_Entries):
    """The light of K LEDs as functions of normal and position."""

    images: Annotated[None, BeforeValidator(_no_scan)] = None
    leds: LedCount = Field(alias="nL")
    width: Annotated[int, Ge(1)]
    height: Annotated[int, Ge(1)]
    pixel_size: PixelSide = Field(alias="mmperpixel")
    linear: Matrix = Field(alias="linfit")
    """R x K m: m is 3, or 4 with a scale."""
    quadratic: Matrix = Field(alias="quadfit")
    """R x K m: m is 10, or 11 with a scale."""
    black: Annotated[list[Annotated[float, Interval(ge=0, lt=1)]], Len(1)] = []
    """Light in the shadow of each LED."""
    flat: FlatField | None = Field(None, alias="flatfield")


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
    said = _read(file, _ScanFile)
    for name in said.images:
        if PureWindowsPath(name).name != name:
            raise InputError(
                f"{file}: images: '{name}' must be the name of a file beside {SCAN_FILE}"
            )
    if len(set(said.images)) < len(said.images):
        raise InputError(f"{file}: images: names a file twice")
    if any(said.crop):
        raise InputError(
            f"{file}: crop: what it counts from is not known; set it to [0, 0, 0, 0] and give "
            "`crop`=x0,y0,x1,y1"
        )
    of_target = said.target.radius if said.target else 0.0
    return Scan(
        [folder / name for name in said.images],
        said.mmperpixel or 0.0,
        PureWindowsPath(str(said.calib or "")).name,
        [Circle(int(m.gx), int(m.gy), m.x, m.y, m.r) for m in said.annotations if m],
        of_target if said.calibradius is None else said.calibradius,
    )


def find_light_model(folder: Path) -> Path:
    """The light model that a scan names, in its folder or the one above.

    Raises
    ------
    InputError
        If it names none, or none is there.
    """
    name = read_scan(folder).model
    if not name:
        raise InputError(f"{folder / SCAN_FILE}: names no light model; give it as `file`=FILE.yaml")
    for place in (folder / name, folder.parent / name):
        with contextlib.suppress(OSError):  # of a name that is too long
            if place.is_file():
                return place
    raise InputError(f"{folder}: its light model {name} is not there; give it as `file`=FILE.yaml")


def read_light_model_file(file: Path) -> LightModelFile:
    """Read a light model.

    Raises
    ------
    InputError
        If it cannot be read, or a matrix does not have the size that LEDs and terms demand.
    """
    said = _read(file, LightModelFile)
    if said.width * said.height > MAX_PIXELS:
        raise InputError(f"{file}: {said.width} x {said.height} px are no frame of a camera")
    for name, values in (("black", said.black), ("scale", said.flat.scale if said.flat else [])):
        if len(values) not in (0, said.leds):
            raise InputError(f"{file}: {name}: {len(values)} values for {said.leds} LEDs")
    for name, matrix, terms in (
        ("linfit", said.linear, 3),
        ("quadfit", said.quadratic, LIGHT_TERMS),
    ):
        rows, columns, count = matrix.rows, matrix.cols, len(matrix.values)
        if rows not in DEGREE_BY_ROWS:
            known = ", ".join(map(str, DEGREE_BY_ROWS))
            raise InputError(f"{file}: {name}: has {rows} rows; known are {known}")
        if columns not in (said.leds * terms, said.leds * (terms + 1)) or count != rows * columns:
            raise InputError(
                f"{file}: {name}: {count} values in {rows} rows of {columns} are not {terms} or "
                f"{terms + 1} for each of {said.leds} LEDs"
            )
    return said


def _read(file: Path, kind: type[Entries]) -> Entries:
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
    document = parse_yaml(_DOUBLE_COLON.sub(r"\1 ", text), str(file))
    if not isinstance(document.data, dict):
        raise InputError(f"{file}: holds no entries such as 'images:' or 'quadfit:'")
    return document.checked(kind)


def _text(raw: bytes, file: Path) -> str:
    for encoding in ("utf-8-sig", "cp1252"):
        with contextlib.suppress(UnicodeDecodeError):
            if b"\0" not in raw:
                return raw.decode(encoding)
    raise InputError(f"{file}: is not a text file")
