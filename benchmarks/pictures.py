"""Draw the pictures of docs/accuracy.md from a simulated capture.

    python benchmarks/pictures.py [--out docs/pictures]

A cat under four LEDs 55 mm away is rendered, and measured with `precise`: its labels, the
heights that its shadows measure, and the error band along a section.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from one_run import run

from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.result import Result
from tactograph.graph.show.colours import BIT_COLOURS

ROOT = Path(__file__).resolve().parents[1]
PIXEL_MM = 1 / 14
NEAR: dict[str, Any] = {"slant_deg": 33.0, "distance_mm": 55.0, "pixel_size_mm": PIXEL_MM}
CAT = {
    "width_px": "$width_px",
    "height_px": "$height_px",
    "pixel_size_mm": "$pixel_size_mm",
}
BAND = 1.645


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/pictures")
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        found = measure_cat(Path(folder))
        truth = np.load(Path(folder) / "cat" / "truth_height_mm.npy")
    draw_labels(found, out / "labels.png")
    draw_rises(found, out / "shadow_constraints.png")
    draw_band(found, truth, out / "error_band.png")


def measure_cat(folder: Path) -> Result:
    """Simulate, calibrate and measure; the rises of the last pass are kept too."""
    ball, flat, cat = (str(folder / name) for name in ("ball", "flat", "cat"))
    run("simulate", out=ball, radius_mm=7.0, seed=1, **NEAR)
    run("simulate_flat", out=flat, seed=2, **NEAR)
    change = {"replace": "shape", "op": "shape_cat", "settings": CAT}
    shape = apply_patch(read_graph("simulate"), change, {"": Place("pictures", 0, 0, "shape")})
    run(shape, out=cat, seed=3, **NEAR)
    file = str(folder / "cal.npz")
    run(
        "calibrate",
        capture=ball,
        flat=flat,
        ball_radius_mm=7.0,
        pixel_size_mm=PIXEL_MM,
        out=file,
    )
    precise = read_graph("precise")
    more = {part: f"passes.rises.{part}" for part in ("top", "foot", "rise", "led")}
    precise = replace(precise, outputs={**precise.outputs, **more})
    return run(precise, capture=cat, calibration=file, out=str(folder / "result"))


def new_axes(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots()


def draw_labels(found: Result, file: Path) -> None:
    """The shadow of each LED in its colour, over the height."""
    figure, axes = new_axes(6, 4.5)
    axes.imshow(found["height"], cmap="gray")
    for k, colour in enumerate(BIT_COLOURS[:4]):
        axes.contour(found["shadow"] >> k & 1, [0.5], colors=[colour], linewidths=1)
        axes.plot([], [], color=colour, label=f"LED {k + 1}")
    axes.legend(loc="lower right")
    axes.set(xlabel="x / px", ylabel="y / px", title="shadow labels")
    figure.savefig(file, dpi=90)


def draw_rises(found: Result, file: Path) -> None:
    """Each measurement as a line from the shadow's end to the edge that casts it."""
    figure, axes = new_axes(6, 4.5)
    axes.imshow(found["height"], cmap="gray")
    columns = found["height"].shape[1]
    ends = [
        np.stack([found[name] % columns, found[name] // columns], 1) for name in ("foot", "top")
    ]
    segments = np.stack(ends, axis=1)[::3]
    lines = LineCollection(list(segments), cmap="plasma", linewidths=0.8)
    lines.set_array(found["rise"][::3])
    axes.add_collection(lines)
    figure.colorbar(lines, ax=axes, label="measured rise / mm")
    title = f"every third of {found['rise'].size} heights measured by shadows"
    axes.set(xlabel="x / px", ylabel="y / px", title=title)
    figure.savefig(file, dpi=90)


def draw_band(found: Result, truth: np.ndarray, file: Path) -> None:
    """The error of the height along a section, within the band that is stated."""
    figure, axes = new_axes(7, 3.2)
    row = int(np.unravel_index(int(truth.argmax()), truth.shape)[0])
    across = np.arange(truth.shape[1]) * PIXEL_MM
    half = 1e3 * BAND * found["error"][row]
    axes.fill_between(across, -half, half, alpha=0.3, label="stated 90 % band")
    axes.plot(across, 1e3 * (found["height"][row] - truth[row]), linewidth=1, label="error")
    axes.set(xlabel="x / mm", ylabel="µm", title=f"error along y = {row * PIXEL_MM:.1f} mm")
    axes.set_ylim(-60, 60)
    axes.legend()
    figure.savefig(file, dpi=90)


if __name__ == "__main__":
    main()
