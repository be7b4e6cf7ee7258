"""The content of a calibration of either kind, or of that of a camera's lens."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph import InputError
from tactograph.graph.disk.array_files import load_arrays
from tactograph.graph.disk.file_identity import ABOUT_ARRAY, about_in
from tactograph.nodes import F4
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND
from tactograph.nodes.calibrate.file.camera_lens import CAMERA_KIND
from tactograph.nodes.calibrate.file.press_calibration import PRESS_CALIBRATION
from tactograph.nodes.files.calibration_file import (
    FileKind,
    is_of_kind,
    read_about,
    read_arrays,
)
from tactograph.nodes.optics.lens import seen_places
from tactograph.nodes.show.shown import Shown, figures, first, origin, section, sentences

FILE_KINDS = (CALIBRATION_KIND, PRESS_CALIBRATION, CAMERA_KIND)
MAX_NUMBERS = 8
"""Most numbers of an array that are printed one by one."""
MARKS_ACROSS = 12
"""Places across the image at which a lens's displacement is drawn."""

LABELS_ACROSS = 15
"""LEDs nearer to each other than such a part of their distance share a label."""
LABEL_PLACE: dict[str, Any] = {"xytext": (-5, 4), "textcoords": "offset points", "ha": "right"}


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
    figure = Figure(figsize=(3 * len(flat), 7), dpi=100, layout="constrained")
    grid = figure.add_gridspec(2, 1)
    upper, lower = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    for k, (axes, plane) in enumerate(zip(upper.subplots(1, len(flat)), flat, strict=True)):
        # From zero on, what LEDs leave uneven would not be seen.
        drawn = axes.imshow(plane, cmap="gray")
        axes.set(title=f"film at rest, LED {k + 1}", xlabel="x / px", ylabel="y / px")
        figure.colorbar(drawn, ax=axes, orientation="horizontal", label="of full scale")
    if "lights" in arrays:
        _draw_leds(lower.subplots(1, 2), arrays)
    else:
        _draw_map(lower, arrays["reflectance"], len(flat))
    figure.suptitle(title)
    FigureCanvasAgg(figure).print_png(target)


def _draw_leds(axes: Any, arrays: dict[str, Any]) -> None:
    """Draw where the LEDs are, with the other places that the fit allows, and the film."""
    lights, others = arrays["lights"], arrays["others"]
    width, height = arrays["pixel_size"] * np.array(arrays["flat"].shape[:0:-1])
    above, side = axes
    _dots(above, lights[:, 0], lights[:, 1], others[..., 0], others[..., 1])
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [width / 2, height / 2]
    above.plot(*box.T, color="black", label="film in the image")
    above.set(title="LEDs from above", xlabel="x / mm", ylabel="y / mm", aspect="equal")
    above.invert_yaxis()
    from_axis, others_from_axis = (
        np.hypot(each[..., 0], each[..., 1]) for each in (lights, others)
    )
    _dots(side, from_axis, lights[:, 2], others_from_axis, others[..., 2])
    side.plot([0, width / 2], [0, 0], color="black", label="film in the image")
    side.set(
        title="LEDs from the side", xlabel="from the axis / mm", ylabel="z / mm", aspect="equal"
    )
    side.legend(loc="center left", bbox_to_anchor=(1.05, 0.5))


def _dots(axes: Axes, x: F4, y: F4, other_x: F4, other_y: F4) -> None:
    axes.plot(other_x.ravel(), other_y.ravel(), ".", color="#9a9a9a", label="as the fit allows")
    axes.plot(x, y, "o", color="#ffb000", label="LEDs")
    axes.margins(0.15)
    places = np.stack([x, y], axis=1)
    named: dict[int, list[str]] = {}
    for k, place in enumerate(places):
        near = np.abs(places[: k + 1] - place).max(axis=1) <= np.abs(places).max() / LABELS_ACROSS
        named.setdefault(int(near.argmax()), []).append(str(k + 1))
    for k, names in named.items():
        axes.annotate(", ".join(names), places[k], **LABEL_PLACE)


def _draw_map(part: Any, reflectance: F4, count: int) -> None:
    """Draw the change of each light with a slope in x and in y, in the middle of the film."""
    axes = part.subplots(1, 1)
    places = np.arange(count)
    for shift, (number, name) in enumerate(((0, "x"), (1, "y"))):
        axes.bar(
            places + 0.4 * shift, reflectance[:, number, 0], 0.4, label=f"normal towards {name}"
        )
    axes.set_xticks(places + 0.2, [f"light {k + 1}" for k in places])
    axes.set(title="change of light in the middle of the film, per unit of the normal")
    axes.legend()


def _draw_lens(arrays: dict[str, Any], title: str, target: Path) -> None:
    """Draw the displacements at which the camera sees places of an even grid."""
    columns, rows = (int(side) for side in arrays["size"])
    figure = Figure(figsize=(8, 8 * rows / columns + 1), dpi=100, layout="constrained")
    axes = figure.subplots()
    step = max(columns // MARKS_ACROSS, 1)
    seen = [plane[::step, ::step] for plane in seen_places(arrays["lens"], (rows, columns))]
    y, x = (plane[::step, ::step] for plane in np.mgrid[:rows, :columns])
    axes.plot(x.ravel(), y.ravel(), ".", color="#9a9a9a", label="even grid")
    axes.plot(
        *(plane.ravel() for plane in seen), "+", color="#ffb000", label="as the camera sees it"
    )
    axes.set(title=title, xlabel="x / px", ylabel="y / px", aspect="equal")
    axes.invert_yaxis()
    axes.legend()
    FigureCanvasAgg(figure).print_png(target)
