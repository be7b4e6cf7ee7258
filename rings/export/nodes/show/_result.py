"""The content of a result's folder."""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.export.nodes.read_pixel_size import read_pixel_size
from tactograph.rings.export.shown import Shown, figures, first, origin, section, sentences
from tactograph.sdk import (
    ColourMap,
    InputError,
    draw_height,
    draw_map,
    layer_kinds,
    read_height_file,
)
from tactograph.sdk.unstable import check_heights, checksum, layer_files, read_numbers

HEIGHT_FILE = "height.npy"


def show_result(file: Path) -> Shown:
    """Return origin, figures and warnings of a ``result.json``; height and maps to draw.

    Raises
    ------
    InputError
        If the file is damaged, or no result.
    """
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    if not isinstance(result, dict) or not isinstance(result.get("graph"), dict):
        raise InputError(f"{file}: not a result of this program")
    metrics = result.get("metrics")
    numbers = metrics if isinstance(metrics, dict) else {}
    warnings = sentences(result.get("warnings"))
    named = result.get("files")
    layers = layer_files(named) if isinstance(named, list) else {}
    lines = [
        f"{file}: result",
        *origin(result),
        *(section("warnings", first(warnings)) or ["warnings: none"]),
        *section("figures", figures({n: v for n, v in numbers.items() if _is_number(v)})),
        *section("layers", [f"  {name}: {', '.join(files)}" for name, files in layers.items()]),
        *section("not as they were written", first(_not_as_written(file, result.get("checksums")))),
    ]
    height = file.parent / HEIGHT_FILE
    if not height.is_file():
        return Shown(lines, {})
    return Shown(lines, {"height.png": partial(_draw, height), **_maps(height, layers)})


def _maps(height: Path, layers: Mapping[str, list[str]]) -> dict[str, Callable[[Path], None]]:
    """How to draw the layers of a result that are maps, by file."""
    drawn: dict[str, Callable[[Path], None]] = {}
    for name, files in layers.items():
        if (array := f"{name}.npy") in files:
            how = layer_kinds()[name].drawn
            if isinstance(how, ColourMap):
                drawn[f"{name}.png"] = partial(_draw_map, height, height.parent / array, how)
    return drawn


def _draw_map(height: Path, array: Path, how: ColourMap, target: Path) -> None:
    plane = read_numbers(array)
    if plane.ndim != 2 or not plane.size:
        raise InputError(f"{array}: a map H x W is needed, not {plane.shape}")
    draw_map(plane, how, read_pixel_size(height=height), target)


def _not_as_written(result: Path, checksums: Any) -> list[str]:
    """The files of a result that are gone, or are others than it was written with."""
    stated = checksums if isinstance(checksums, dict) else {}
    files = {result.parent / name: sum_ for name, sum_ in stated.items() if name == Path(name).name}
    return [
        f"  {file.name}: {'changed' if file.is_file() else 'missing'}"
        for file, sum_ in files.items()
        if not file.is_file() or checksum(file) != sum_
    ]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))


def _draw(height: Path, target: Path) -> None:
    height_mm, pixel = read_height_file(height).height, read_pixel_size(height=height)
    check_heights(height_mm, height, unknown=True)
    draw_height(height_mm, None, pixel, target)
