"""Assign the images of a folder to LEDs."""

import re
from collections.abc import Sequence
from pathlib import Path

from tactograph.graph import InputError, warn
from tactograph.graph.errors import a_few
from tactograph.nodes.capture.listed_capture import listed_capture
from tactograph.nodes.files.image_files import MAX_LEDS

IMAGE_SUFFIXES = (".png", ".tiff", ".tif", ".pgm", ".bmp", ".jpg", ".jpeg")
MIN_LEDS = 3
MIN_TIMESTAMP = 10**5
"""Smallest number that counts as a photograph's time, as in 20210425_093012: times have gaps."""
MAX_LED_IMAGES = 16
"""Largest number of images that count as those of LEDs if no names are given."""
USUAL_PATTERN = "led{}"
NUMBERED_NAME = re.compile(r"(.*?)(\d+)(\D*)", re.DOTALL)
"""Name without suffix: the part before its last number, the number, and the rest."""
LIGHTS_ADVICE = "give `lights`=bgr"

LEDS_ADVICE = "'leds: [1, 2, ...]' in capture.yaml"
Named = dict[int, Path]
"""Images of one name by their numbers."""


def images_of(folder: Path) -> list[Path]:
    """Return the image files of a folder in order of name, without hidden ones."""
    files = (f for f in folder.iterdir() if f.suffix.lower() in IMAGE_SUFFIXES and not is_hidden(f))
    return sorted(files)


def colour_frames(folder: Path) -> list[Path]:
    """Return colour images, each a capture, in the order of their numbers; [] for a single one.

    Images with names of LEDs do not count.

    Raises
    ------
    InputError
        If two differ only in their suffix.
    """
    images = images_of(folder)
    if len(images) < 2 or any(re.fullmatch(r"(?i)led\d+", file.stem) for file in images):
        return []
    if len({file.stem for file in images}) < len(images):
        raise InputError(f"{folder}: two images differ in their suffix alone; keep one of them")
    return sorted(images, key=lambda file: [*map(_by_number, re.split(r"(\d+)", file.stem))])


def _by_number(part: str) -> tuple[int, str]:
    return (int(part), "") if part.isdigit() else (-1, part)


def is_hidden(path: Path) -> bool:
    """Return whether a file is hidden: left by a killed writer (`atomic_files`) or the system."""
    return path.name.startswith(".")


def has_led_files(folder: Path, pattern: str, leds: Sequence[int] | None) -> bool:
    """Return whether a folder holds one image per LED."""
    if pattern != USUAL_PATTERN:
        return any(_by_pattern(folder, pattern, leds or range(1, MAX_LED_IMAGES + 1)).values())
    if listed_capture(folder) is not None:
        return True
    groups = _by_name(folder)
    return (USUAL_PATTERN.format(""), "") in groups or any(map(_may_be_leds, groups.values()))


def find_led_files(folder: Path, pattern: str, leds: Sequence[int] | None) -> Named:
    """Return the image of each LED by its number, in the order of `leds`, or of the numbers.

    With the usual pattern, images of any one name with numbers are taken in their order, and a
    message states it; images of other names with numbers are reported as ignored.  Of more LEDs
    than a label holds, eight are taken at even distances in their numbers.  If the capture's own
    file lists images (`listed_capture`), those are taken, in that order.

    Raises
    ------
    InputError
        If an image is missing or duplicate, the names are ambiguous, or there are fewer LEDs than
        a slope needs, or more than `MAX_LED_IMAGES`.
    """
    if leds is not None and len(set(leds)) < len(leds):
        raise InputError(f"{folder}: of LEDs {','.join(map(str, leds))} one is named twice")
    if pattern == USUAL_PATTERN:
        file_of = _numbered_leds(folder)
    else:
        numbers = range(max([MAX_LED_IMAGES, *(leds or ())]) + 1)
        found = {led: file for led, file in _by_pattern(folder, pattern, numbers).items() if file}
        file_of = _from_one(folder, found) if 0 in found else found
    leds_due = leds or range(1, max(file_of, default=1) + 1)
    missing = [led for led in leds_due if led not in file_of]
    if missing:
        name = pattern.format(missing[0])
        if pattern == USUAL_PATTERN and 1 in file_of and _number_of(file_of[1]) != 1:
            last = max(file_of)
            raise InputError(
                f"{folder}: there is no LED {missing[0]}: {file_of[1].stem} to "
                f"{file_of[last].stem} are LEDs 1 to {last}, and `leds` counts as these"
            )
        raise InputError(f"{folder}: the image of LED {missing[0]} is missing ({name}.png)")
    if leds is None and MAX_LEDS < len(leds_due) <= MAX_LED_IMAGES:
        leds_due = [leds_due[number * len(leds_due) // MAX_LEDS] for number in range(MAX_LEDS)]
        warn(
            f"of {len(file_of)} LEDs, {', '.join(map(str, leds_due))} are taken, as labels hold "
            f"{MAX_LEDS}; {LEDS_ADVICE} takes others"
        )
    if not MIN_LEDS <= len(leds_due) <= MAX_LEDS:
        raise InputError(
            f"{folder}: {len(leds_due)} LED images; a slope needs from {MIN_LEDS} to {MAX_LEDS} "
            f"of them ({LEDS_ADVICE}; if the channels of one colour image are the lights, "
            f"{LIGHTS_ADVICE})"
        )
    return {led: file_of[led] for led in leds_due}


def _numbered_leds(folder: Path) -> Named:
    """The images of one name by LED, counted from 1."""
    if (listed := listed_capture(folder)) is not None:
        return dict(enumerate(listed.images, start=1))
    groups = _by_name(folder)
    usual = USUAL_PATTERN.format(""), ""
    likely = [usual] if usual in groups else [n for n, g in groups.items() if _may_be_leds(g)]
    if len(likely) > 1:
        names = " and ".join(next(iter(groups[name].values())).name for name in likely)
        raise InputError(
            f"{folder}: images of several names could be those of the LEDs, such as {names}; "
            "keep one name, or give `files`=NAME{}"
        )
    if not likely:
        return {}
    led_files = groups[likely[0]]
    others = [f.name for n, group in groups.items() if n != likely[0] for f in group.values()]
    if others:
        warn(f"{folder}: not read: {a_few(others, 3)}; the images of LEDs have one name")
    if likely[0] == usual and min(led_files) == 1:
        return led_files
    return _from_one(folder, led_files)


def _from_one(folder: Path, led_files: Named) -> Named:
    """Images by numbers that follow one another, as those of LEDs counted from 1."""
    files = [*led_files.values()]
    steps = {after - before for before, after in zip(led_files, [*led_files][1:], strict=False)}
    if len(steps) > 1 and min(led_files) < MIN_TIMESTAMP:
        raise InputError(
            f"{folder}: {', '.join(file.name for file in files[:MAX_LEDS])}: an image is missing; "
            "the numbers of the LEDs' images follow one another"
        )
    warn(f"{files[0].stem} to {files[-1].stem} are taken as LEDs 1 to {len(files)}")
    return dict(enumerate(files, start=1))


def _number_of(file: Path) -> int | None:
    match = NUMBERED_NAME.fullmatch(file.stem)
    return int(match[2]) if match else None


def _may_be_leds(group: Named) -> bool:
    return len(group) >= MIN_LEDS


def _by_name(folder: Path) -> dict[tuple[str, str], Named]:
    """The numbered images of a folder, grouped by the parts before and after their numbers.

    Upper and lower case are the same name, and so are numbers with and without leading zeros.
    """
    groups: dict[tuple[str, str], Named] = {}
    for file in images_of(folder):
        match = NUMBERED_NAME.fullmatch(file.stem)
        if match is None:
            continue
        before, number, behind = match.groups()
        group = groups.setdefault((before.lower(), behind.lower()), {})
        if (other := group.get(int(number))) is not None:
            raise InputError(
                f"{folder}: {other.name} and {file.name} are both there; keep the one that is meant"
            )
        group[int(number)] = file
    return {name: dict(sorted(group.items())) for name, group in groups.items()}


def _by_pattern(folder: Path, pattern: str, leds: Sequence[int]) -> dict[int, Path | None]:
    """The image of each LED.

    The folder is listed once, which is faster than testing every possible file name.
    """
    try:
        listed = {file.name.lower() for file in (folder / pattern).parent.iterdir()}
    except OSError:  # each LED has a folder of its own, or there is none
        listed = None
    return {led: _find_one(folder, pattern, led, listed) for led in leds}


def _find_one(folder: Path, pattern: str, led: int, listed: set[str] | None) -> Path | None:
    try:
        stem = pattern.format(led)
        if stem == pattern:
            raise ValueError
    except (ValueError, IndexError, KeyError, AttributeError):
        raise InputError(f"`files`={pattern}: write it as led{{}} or image{{:02}}") from None
    name = stem.rpartition("/")[2].lower()
    likely = (s for s in IMAGE_SUFFIXES if listed is None or f"{name}{s}" in listed)
    matching = [file for s in likely if (file := folder / f"{stem}{s}").is_file()]
    if len(matching) > 1:
        names = " and ".join(file.name for file in matching)
        raise InputError(f"{folder}: {names} are both there; keep the one that is meant")
    return matching[0] if matching else None
