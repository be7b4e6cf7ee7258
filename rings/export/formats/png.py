"""16-bit grey: height = offset + level * step, both stated in a text chunk."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, PngImagePlugin

from tactograph.rings.export.height_levels import (
    OFFSET_MM,
    STEP_MM,
    UNKNOWN_LEVEL,
    height_levels,
    level_height,
)
from tactograph.sdk import Height, HeightError, HeightFile, InputError

PNG_TEXT = "Tactograph height"
"""The PNG's text chunk that holds step and offset."""


def write(file: Path, height: Height, pixel: float, _: HeightError | None) -> None:
    """Write heights in mm; the error is left out.

    Unknown film, NaN, is transparent by the PNG's tRNS chunk.

    Raises
    ------
    InputError
        If the height does not fit into 16 bits at this scale.
    """
    try:
        grey = height_levels(height)
    except InputError as error:
        raise InputError(f"{file.name}: {error}; write tiff or npy instead") from None
    about = {"unit": "mm", "step": STEP_MM, "offset": OFFSET_MM, "pixel_size_mm": pixel}
    transparent: dict[str, Any] = {}
    if not np.isfinite(height).all():
        about["unknown_level"] = transparent["transparency"] = UNKNOWN_LEVEL
    text = PngImagePlugin.PngInfo()
    text.add_text(PNG_TEXT, json.dumps(about))
    Image.fromarray(grey).save(file, pnginfo=text, **transparent)


def read(file: Path) -> HeightFile:
    """16-bit grey that states its own scale."""
    try:
        with Image.open(file) as image:
            about = json.loads(image.info[PNG_TEXT])
            levels = np.asarray(image)
        step, offset = float(about["step"]), float(about["offset"])
        side = float(about.get("pixel_size_mm", math.nan))
    except (KeyError, TypeError):
        raise InputError(f"{file}: states no scale, so its grey levels are no heights") from None
    except (OSError, SyntaxError, ValueError, OverflowError) as error:
        raise InputError(f"{file}: cannot be decoded: {error}") from None
    height = level_height(levels, step, offset)
    if "unknown_level" in about:
        height[levels == about["unknown_level"]] = np.nan
    return HeightFile.of(height, side, side)
