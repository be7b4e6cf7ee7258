"""The content of a calibration of any kind, or of that of a camera's lens."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.export.summary import Summary, figures, first, origin, section, sentences
from tactograph.sdk import FileKind, InputError

MAX_NUMBERS = 8
"""Most numbers of an array that are printed one by one."""


def show_calibration(file: Path) -> Summary:
    """Return verdict, settings, figures, arrays and picture of a calibration.

    Raises
    ------
    InputError
        If the file is damaged, or no calibration.
    """
    file_kind = FileKind.module_of(file)
    if file_kind is None:
        raise InputError(f"{file}: is neither a calibration nor a lens")
    kind: FileKind = file_kind.KIND
    arrays, about = kind.read(file)
    verdict = "doubtful" if about.doubts else "nothing speaks against it"
    head, provenance = about.head, about.head.get("provenance")
    warnings = sentences(provenance.get("warnings") if isinstance(provenance, dict) else None)
    others = [line for line in warnings if line.strip() not in about.doubts]
    lines = [
        f"{file}: {kind.name}, format {kind.format}",
        *_words(head, "sensor", "serial", "date"),
        *origin(provenance),
        *([f"verdict: {verdict}"] if "flat" in kind.values else []),
        *first(sentences(about.doubts)),
        *section("warnings", first(others)),
        *_words(head, "advice"),
        *section("figures", figures(about.quality)),
        *section("values", _values(arrays, kind)),
    ]
    draw = partial(_draw, file_kind.draw, arrays, str(file))
    return Summary(lines, {f"{file.stem}.png": draw})


def _draw(inside: Callable[..., None], arrays: Mapping[str, Any], title: str, target: Path) -> None:
    """Draw what a kind draws; of a sensor below the film at rest under every LED."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # takes 0.5 s
    from matplotlib.figure import Figure

    if "flat" not in arrays:
        figure = Figure(dpi=100, layout="constrained")
        inside(figure, arrays)
    else:
        flat = arrays["flat"]
        figure = Figure(figsize=(3 * len(flat), 7), dpi=100, layout="constrained")
        grid = figure.add_gridspec(2, 1)
        upper, lower = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
        for k, (axes, plane) in enumerate(zip(upper.subplots(1, len(flat)), flat, strict=True)):
            # From zero on, what LEDs leave uneven would not be seen.
            drawn = axes.imshow(plane, cmap="gray")
            axes.set(title=f"film at rest, LED {k + 1}", xlabel="x / px", ylabel="y / px")
            figure.colorbar(drawn, ax=axes, orientation="horizontal", label="of full scale")
        inside(lower, arrays)
    figure.suptitle(title)
    FigureCanvasAgg(figure).print_png(target)


def _words(head: Mapping[str, Any], *names: str) -> list[str]:
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
