"""Light models as GelSight's software stores them: the light of each LED by normal and place."""

import contextlib
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Interval, Len
from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from tactograph.rings.metrology.nodes.scan.scan_file import (
    SCAN_FILE,
    ScanEntries,
    read_entries,
    read_scan,
)
from tactograph.sdk import ImageFile, InputError, PixelSize

LIGHT_TERMS = 10
"""Terms of the light model per LED: a00, a01, a02, a11, a12, a22, b0, b1, b2, c."""
DEGREE_BY_ROWS = {1: 0, 3: 1, 6: 2, 10: 3, 15: 4}
"""Rows of a matrix, and the degree in the position that they stand for; the highest degree
comes first, within a degree falling in u."""
LedCount = Annotated[int, Interval(ge=3, le=8)]


def _no_scan(_: object) -> None:
    raise PydanticCustomError("scan", "is a scan; give its folder, or the model that it names")


class Matrix(ScanEntries):
    """A matrix as it is stored, row by row."""

    rows: int
    cols: int
    values: list[float]


class FlatField(ScanEntries):
    """Flat frames of all LEDs in one image, three tiles a row, and the scale of each."""

    image: str = Field(alias="modelfile")
    scale: Annotated[list[Annotated[float, Gt(0)]], Len(1)]


class LightModelFile(ScanEntries):
    """The light of K LEDs as functions of normal and position."""

    images: Annotated[None, BeforeValidator(_no_scan)] = None
    leds: LedCount = Field(alias="nL")
    width: Annotated[int, Ge(1)]
    height: Annotated[int, Ge(1)]
    pixel_size: PixelSize = Field(alias="mmperpixel")
    linear: Matrix = Field(alias="linfit")
    """R x K m: m is 3, or 4 with a scale."""
    quadratic: Matrix = Field(alias="quadfit")
    """R x K m: m is 10, or 11 with a scale."""
    black: Annotated[list[Annotated[float, Interval(ge=0, lt=1)]], Len(1)] = Field(
        default_factory=list
    )
    """Light in the shadow of each LED."""
    flat: FlatField | None = Field(None, alias="flatfield")


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
    entries = read_entries(file, LightModelFile)
    if entries.width * entries.height > ImageFile.MAX_PIXELS:
        raise InputError(f"{file}: {entries.width} x {entries.height} px are no frame of a camera")
    for name, values in (
        ("black", entries.black),
        ("scale", entries.flat.scale if entries.flat else []),
    ):
        if len(values) not in (0, entries.leds):
            raise InputError(f"{file}: {name}: {len(values)} values for {entries.leds} LEDs")
    for name, matrix, terms in (
        ("linfit", entries.linear, 3),
        ("quadfit", entries.quadratic, LIGHT_TERMS),
    ):
        rows, columns, count = matrix.rows, matrix.cols, len(matrix.values)
        if rows not in DEGREE_BY_ROWS:
            counts = ", ".join(map(str, DEGREE_BY_ROWS))
            raise InputError(f"{file}: {name}: has {rows} rows; known are {counts}")
        if (
            columns not in (entries.leds * terms, entries.leds * (terms + 1))
            or count != rows * columns
        ):
            raise InputError(
                f"{file}: {name}: {count} values in {rows} rows of {columns} are not {terms} or "
                f"{terms + 1} for each of {entries.leds} LEDs"
            )
    return entries
