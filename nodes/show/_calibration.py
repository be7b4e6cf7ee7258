"""The content of a calibration of either kind, or of that of a camera's lens."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph import InputError
from tactograph.graph.disk.array_files import load_arrays
from tactograph.graph.disk.file_identity import ABOUT_ARRAY, about_in
from tactograph.nodes import F4
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND
from tactograph.nodes.calibrate.file.camera_lens import CAMERA_KIND
from tactograph.nodes.calibrate.file.press_calibration import PRESS_CALIBRATION
from tactograph.nodes.drawing.chart import BLUE, GREY, ORANGE, Axes, Page, pixel_ends
from tactograph.nodes.files.calibration_file import (
    FileKind,
    is_of_kind,
    read_about,
    read_arrays,
)
from tactograph.nodes.optics.lens import seen_places
from tactograph.nodes.show._shown import Shown, figures, first, origin, section, sentences

FILE_KINDS = (CALIBRATION_KIND, PRESS_CALIBRATION, CAMERA_KIND)
MAX_NUMBERS = 8
"""Most numbers of an array that are printed one by one."""
MARKS_ACROSS = 12
"""Places across the image at which a lens's displacement is drawn."""


def show_calibration(file: Path) -> Shown:
    """Return verdict, settings, figures, arrays and picture of a calibration.

    Raises
    ------
    InputError
        If the file is damaged, or no calibration.
    """
    kind = next((kind for kind in FILE_KINDS if is_of_kind(file, kind)), None)
    if kind is None:
        raise InputError(f"{file}: is neither a calibration nor a lens")
    arrays = read_arrays(file, kind)
    about, head = read_about(file), about_in(load_arrays(file, only=ABOUT_ARRAY))
    verdict = "doubtful" if about.doubts else "nothing speaks against it"
    if kind is not CAMERA_KIND and "doubts" not in head:
        verdict = "not kept, the file is older; calibrate again"
    made = head.get("made")
    warnings = sentences(made.get("warnings") if isinstance(made, dict) else None)
    others = [line for line in warnings if line.strip() not in about.doubts]
    lines = [
        f"{file}: {kind.name}, format {kind.format}",
        *_words(head, "sensor", "serial", "date"),
        *origin(made),
        *([f"verdict: {verdict}"] if kind is not CAMERA_KIND else []),
        *first(sentences(about.doubts)),
        *section("warnings", first(others)),
        *_words(head, "advice"),
        *section("figures", figures(about.quality)),
        *section("values", _values(arrays, kind)),
    ]
    draw = _draw_lens if kind is CAMERA_KIND else _draw_sensor
    return Shown(lines, {f"{file.stem}.png": partial(draw, arrays, str(file))})


def _words(head: dict[str, Any], *names: str) -> list[str]:
    return [f"{name}: {head[name]}" for name in names if isinstance(head.get(name), str)]


def _values(arrays: dict[str, Any], kind: FileKind) -> list[str]:
    """Every array: its numbers if they are few, else its size and range; and its unit."""
    width = max(map(len, arrays))
    return [
        f"  {name:<{width}}  {_range(np.asarray(array))}  [{kind.values[name].port.meaning}]"
        for name, array in arrays.items()
    ]


def _range(array: Any) -> str:
    if array.size <= MAX_NUMBERS:
        return " ".join(f"{value:.4g}" for value in array.ravel())
    shape = " x ".join(map(str, array.shape))
    return f"{shape}, {array.min():.4g} to {array.max():.4g}"


def _draw_sensor(arrays: dict[str, Any], title: str, target: Path) -> None:
    """Draw the film at rest under every LED, and the LEDs from above and from the side."""
    flat = arrays["flat"]
    page = Page(380 * len(flat), 760, 2, len(flat), f"{title}: light as a share of full scale")
    for k, plane in enumerate(flat):
        name = f"at rest, LED {k + 1}"
        axes = page.axes(0, k, *pixel_ends(plane), name, ("x / px", ""), square=True, bar=True)
        axes.image(plane, ends=(0, float(plane.max())))
        axes.colour_bar()
    if "lights" in arrays:
        _draw_leds(page, arrays)
    else:
        _draw_map(page, arrays["reflectance"], len(flat))
    page.save(target)


def _draw_leds(page: Page, arrays: dict[str, Any]) -> None:
    """Draw where the LEDs are, with the other places that the fit allows, and the film."""
    lights, others = arrays["lights"], arrays.get("others", arrays["lights"][None])
    width, height = arrays["pixel_size"] * np.array(arrays["flat"].shape[:0:-1])
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [width / 2, height / 2]
    far = 1.15 * float(
        np.abs([*lights[:, :2].ravel(), *others[..., :2].ravel(), *box.ravel()]).max()
    )
    names = "x / mm", "y / mm"
    title = "LEDs (orange; grey: as the fit allows) and film in the image"
    above = page.axes(1, 0, (-far, far), (far, -far), title, names, columns=2, square=True)
    _dots(above, lights[:, 0], lights[:, 1], others[..., 0], others[..., 1])
    above.line(box[:, 0], box[:, 1], "black")
    from_axis, others_from_axis = (
        np.hypot(each[..., 0], each[..., 1]) for each in (lights, others)
    )
    top = 1.15 * float(max(lights[:, 2].max(), others[..., 2].max()))
    ends, labels = ((0, 1.5 * far), (-0.05 * top, top)), ("from the axis / mm", "z / mm")
    side = page.axes(1, 1, *ends, "from the side", labels, columns=2, square=True)
    _dots(side, from_axis, lights[:, 2], others_from_axis, others[..., 2])
    side.line([0, width / 2], [0, 0], "black")


def _dots(axes: Axes, x: F4, y: F4, other_x: F4, other_y: F4) -> None:
    axes.dots(other_x, other_y, GREY)
    axes.dots(x, y, ORANGE, size_px=4.0)
    for k, place in enumerate(zip(x, y, strict=True), start=1):
        axes.write(f"  {k}", *map(float, place), anchor="ld")


def _draw_map(page: Page, reflectance: F4, count: int) -> None:
    """Draw the change of each light with a slope in x and in y, in the middle of the film."""
    change = reflectance[:, :2, 0]
    ends = 1.1 * min(0, float(change.min())), 1.1 * max(0, float(change.max()))
    title = "change of light in the middle of the film, per unit of the normal: blue x, orange y"
    names = {k: f"light {k + 1}" for k in range(count)}
    axes = page.axes(1, 0, (-0.6, count - 0.4), ends, title, names=(names, None), columns=1)
    for k, (across, down) in enumerate(change):
        axes.area([k - 0.35, k], 0, across, BLUE)
        axes.area([k, k + 0.35], 0, down, ORANGE)


def _draw_lens(arrays: dict[str, Any], title: str, target: Path) -> None:
    """Draw the displacements at which the camera sees places of an even grid."""
    columns, rows = (int(side) for side in arrays["size"])
    page = Page(800, round(800 * rows / columns) + 100)
    words, labels = f"{title}: even grid (grey) as the camera sees it", ("x / px", "y / px")
    axes = page.axes(0, 0, (-0.5, columns - 0.5), (rows - 0.5, -0.5), words, labels, square=True)
    step = max(columns // MARKS_ACROSS, 1)
    seen_x, seen_y = seen_places(arrays["lens"], (rows, columns))
    y, x = (plane[::step, ::step] for plane in np.mgrid[:rows, :columns])
    axes.dots(x, y, GREY)
    axes.dots(seen_x[::step, ::step], seen_y[::step, ::step], ORANGE)
    page.save(target)
