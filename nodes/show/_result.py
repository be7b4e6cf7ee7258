"""What is in the folder of a result."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph import InputError
from tactograph.nodes.drawing.result_pictures import draw_height
from tactograph.nodes.files.height_files import read_height_file
from tactograph.nodes.files.image_files import check_heights
from tactograph.nodes.files.result_file import checksum
from tactograph.nodes.show._shown import Shown, figures, first, origin, section, sentences
from tactograph.nodes.write.read_pixel_size import read_pixel_size

HEIGHT = "height.npy"


def show_result(file: Path) -> Shown:
    """Return origin, figures and warnings of a ``result.json``, and its height to draw.

    Raises
    ------
    InputError
        If the file is damaged, or no result.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    if not isinstance(found, dict) or not isinstance(found.get("graph"), dict):
        raise InputError(f"{file}: not a result of this program")
    metrics = found.get("metrics")
    numbers = metrics if isinstance(metrics, dict) else {}
    warnings = sentences(found.get("warnings"))
    lines = [
        f"{file}: result",
        *origin(found),
        *(section("warnings", first(warnings)) or ["warnings: none"]),
        *section("figures", figures({n: v for n, v in numbers.items() if _is_number(v)})),
        *section("not as they were written", first(_not_as_written(file, found.get("checksums")))),
    ]
    height = file.parent / HEIGHT
    return Shown(lines, {"height.png": partial(_draw, height)} if height.is_file() else {})


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
    found, pixel = read_height_file(height).height, read_pixel_size(height=height)
    check_heights(found, height, unknown=True)
    draw_height(found, None, pixel, target)
