"""Scans as GelSight's software stores them: ``scan.yaml``, and images beside it.

That software writes YAML by hand: keys without a value (``fov:      : 5``), Windows' paths,
sizes as ``[a, b]`` or ``(a, b)``, text in the encoding of Windows.  A scan lists its images in the
order of the LEDs.
"""

import contextlib
import re
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, NamedTuple, TypeVar

from annotated_types import Interval, Len
from pydantic import BaseModel, BeforeValidator, ConfigDict

from tactograph.sdk import Document, InputError, PixelSize

SCAN_FILE = "scan.yaml"
MAX_BYTES = 1_000_000
BallRadius = Annotated[float, Interval(ge=0, lt=1e3)]
_DOUBLE_COLON = re.compile(r"^(\s*[A-Za-z_]\w*\s*:)\s+:\s*", re.MULTILINE)


class MarkedBall(NamedTuple):
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
    balls: tuple[MarkedBall, ...]
    ball_radius: float
    """mm; 0 where it is unknown."""


class ScanEntries(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Mark(ScanEntries):
    gx: float
    gy: float
    x: float
    y: float
    r: float


def _ball(mark: Any) -> Any:
    """A mark of a scan, None if it is of another kind."""
    return mark if isinstance(mark, dict) and mark.get("type") == "GridCircle" else None


class _Target(ScanEntries):
    radius: BallRadius = 0.0


class _ScanFile(ScanEntries):
    images: Annotated[list[str], Len(1)]
    crop: list[float] = []
    mmperpixel: Annotated[
        PixelSize | None, BeforeValidator(lambda size: None if size == 0 else size)
    ] = None
    calibradius: BallRadius | None = None
    target: Annotated[
        _Target | None, BeforeValidator(lambda entry: entry if isinstance(entry, dict) else None)
    ] = None
    annotations: Annotated[
        list[Annotated[_Mark | None, BeforeValidator(_ball)]], BeforeValidator(lambda a: a or [])
    ] = []
    calib: Any = None


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
    entries = read_entries(file, _ScanFile)
    for name in entries.images:
        if PureWindowsPath(name).name != name:
            raise InputError(
                f"{file}: images: '{name}' must be the name of a file beside {SCAN_FILE}"
            )
    if len(set(entries.images)) < len(entries.images):
        raise InputError(f"{file}: images: names a file twice")
    if any(entries.crop):
        raise InputError(
            f"{file}: crop: what it counts from is not known; set it to [0, 0, 0, 0] and give "
            "`crop`=x0,y0,x1,y1"
        )
    of_target = entries.target.radius if entries.target else 0.0
    return Scan(
        [folder / name for name in entries.images],
        entries.mmperpixel or 0.0,
        PureWindowsPath(str(entries.calib or "")).name,
        tuple(MarkedBall(int(m.gx), int(m.gy), m.x, m.y, m.r) for m in entries.annotations if m),
        of_target if entries.calibradius is None else entries.calibradius,
    )


Kind = TypeVar("Kind", bound=ScanEntries)


def read_entries(file: Path, kind: type[Kind]) -> Kind:
    """Return the entries of a file of that software, its slips mended.

    Raises
    ------
    InputError
        If it cannot be read, or an entry is invalid.
    """
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from None
    if len(raw) > MAX_BYTES:
        raise InputError(f"{file}: is larger than {MAX_BYTES // 1000} kB; no scan or light model")
    text = _text(raw, file)
    if not text.strip():
        raise InputError(f"{file}: the file is empty")
    document = Document.parse(_DOUBLE_COLON.sub(r"\1 ", text), str(file))
    if not isinstance(document.data, dict):
        raise InputError(f"{file}: holds no entries such as 'images:' or 'quadfit:'")
    return document.checked(kind)


def _text(raw: bytes, file: Path) -> str:
    for encoding in ("utf-8-sig", "cp1252"):
        with contextlib.suppress(UnicodeDecodeError):
            if b"\0" not in raw:
                return raw.decode(encoding)
    raise InputError(f"{file}: is not a text file")
