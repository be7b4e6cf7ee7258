"""Read where the lamps of a capture stand, from a table or the file of a light dome."""

import re
from pathlib import Path

import numpy as np

from tactograph.sdk import F8, InputError, Layout, LightPositions, node, warn

FAR_MM = 1e5
"""Distance of a lamp of which only the direction is known."""
MAX_UNIT_ERROR = 0.02
"""Departure of a direction's length from 1."""
WORD_SEPARATORS = re.compile(r"[\s,;]+")


@node
def read_lamps(*, file: Path, folder: Path) -> LightPositions:
    """Return the place of each lamp in mm, in the order of a capture's images.

    Parameters
    ----------
    file
        A line per lamp that ends in three numbers.  ``.lp``, as of light domes: directions, x
        right, y up, z towards the camera, a name before them and their number first.  Else, as of
        a ``.csv``: places in mm, x right, y down, z towards the camera, from the middle of the
        image on the film at rest; or directions of length 1.  A line without a number is a
        heading.  Names that are those of the images say which lamp is whose; else the order does.
    folder : the capture, one image per lamp

    Returns
    -------
    K x 3; lamps of which only the direction is known stand 100 m away.

    Raises
    ------
    InputError
        If the file is missing or holds no three numbers in a line, a lamp is not above the film,
        directions and places are mixed, or a lamp or an image is missing.
    """
    names, lamps = _read(file)
    images = Layout().led_files(folder)
    stems = [image.stem.lower() for image in images.values()]
    if set(stems) <= set(names):
        lamps = lamps[[names.index(stem) for stem in stems]]
    elif max(images) <= len(lamps):
        lamps = lamps[[led - 1 for led in images]]
    else:
        raise InputError(
            f"{file}: has {len(lamps)} lamps, but {folder} an image of LED {max(images)}; give a "
            "line per image, in their order, or begin lines with the images' names"
        )
    length = np.linalg.norm(lamps, axis=1)
    unit = np.abs(length - 1) < MAX_UNIT_ERROR
    if file.suffix.lower() == ".lp":
        if not unit.all():
            raise InputError(
                f"{file}: holds directions of length {length.min():.3g} to {length.max():.3g}, and "
                "1 is needed; write places in mm, y down, into a .csv"
            )
        lamps = lamps * [1, -1, 1]
    if unit.any() != unit.all():
        raise InputError(f"{file}: holds directions of length 1 and places in mm; give one of both")
    if (lamps[:, 2] <= 0).any():
        low = [*images][int(np.argmin(lamps[:, 2]))]
        raise InputError(
            f"{file}: the lamp of LED {low} is not above the film; z points to the camera"
        )
    return far_lamps(lamps) if unit.all() else np.asarray(lamps, np.float32)


def far_lamps(directions: F8) -> LightPositions:
    """Return places far away in directions of length 1, K x 3, and say so."""
    warn("only the lamps' directions are known: they count as far away")
    return np.asarray(FAR_MM * directions / np.linalg.norm(directions, axis=1)[:, None], np.float32)


def _read(file: Path) -> tuple[list[str], F8]:
    """The lamps' names without folder and suffix, in small letters, and three numbers for each."""
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read as text: {error}") from None
    names, lamps = [], []
    for number, line in enumerate(lines, start=1):
        words = [word for word in WORD_SEPARATORS.split(line.strip()) if word]
        if not words or line.lstrip().startswith("#"):
            continue
        place = [_number(word) for word in words[-3:]]
        if len(place) == 3 and None not in place:
            name = re.split(r"[/\\]", " ".join(words[:-3]))[-1]
            names.append(Path(name).stem.lower())
            lamps.append(place)
        elif lamps or (place[-1] is not None and len(words) > 1):
            raise InputError(f"{file}:{number}: a lamp's line ends in x, y, z, not: {line.strip()}")
    if not lamps:
        raise InputError(f"{file}: holds no lamp; a line per lamp ends in x, y, z")
    return names, np.array(lamps, np.float64)


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
