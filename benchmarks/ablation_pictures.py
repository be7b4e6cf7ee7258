"""The tables and pictures of docs/ablation.md, from the reports of ablation.sh.

Usage: ablation_pictures.py REPORTS PICTURES; the tables are printed.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph.compare.compare import Row
from tactograph.graph.compare.stored_views import load_views
from tactograph.graph.compare.tables import read_rows
from tactograph.graph.show.views import View

SHAPES = ("ball", "teapot", "cat")
SLANT = "lights.slant_deg"
FIGURES = {
    "max_error_px": "maximum error / px",
    "over_10_percent": "pixels over 10 % / %",
    "rmse_px": "RMSE / px",
    "normal_error_deg": "mean normal error / deg",
}
SLANTS_DEG = (30.0, 52.5)
"""Slants whose maps are drawn: a moderate and a flat light."""
COLOURS = {"with": "#1f5fa8", "without": "#d1495b"}


def handling(row: Row) -> str:
    return "without" if row.variant.endswith("no_shadow") else "with"


def views(folder: Path, row: Row) -> dict[str, View]:
    return load_views(folder / row.variant / "preferred" / f"{SLANT}={row.sweep[SLANT]}")


def shares(found: dict[str, View]) -> tuple[float, float]:
    """Per cent of the object's pixels in the shadow of one LED, and of several."""
    dark = np.bitwise_count(found["truth_shadow"].array)[found["truth"].array > 0]
    return 100 * float((dark == 1).mean()), 100 * float((dark > 1).mean())


def print_tables(reports: Path) -> None:
    for shape in SHAPES:
        print(f"\n{shape}\n")
        print(
            "| slant | in one shadow | in several | max error | over 10 % | RMSE | normal error |"
        )
        print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
        rows = {(row.sweep[SLANT], handling(row)): row for row in read_rows(reports / shape)}
        for slant in sorted({slant for slant, _ in rows}):
            pair = [rows[slant, which] for which in ("with", "without")]
            one, several = shares(views(reports / shape, pair[0]))
            cells = [" / ".join(f"{row.figures[name]:.3g}" for row in pair) for name in FIGURES]
            print(f"| {slant:g}° | {one:.1f} % | {several:.1f} % | {' | '.join(cells)} |")


def draw_curves(reports: Path, file: Path) -> None:
    figure = Figure(figsize=(11, 7), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(SHAPES), len(FIGURES), sharex=True)
    for line, shape in zip(grid, SHAPES, strict=True):
        rows = read_rows(reports / shape)
        for ax, (name, title) in zip(line, FIGURES.items(), strict=True):
            for which, colour in COLOURS.items():
                mine = [row for row in rows if handling(row) == which]
                slants = [row.sweep[SLANT] for row in mine]
                values = [row.figures[name] for row in mine]
                ax.plot(slants, values, "o-", color=colour, markersize=3, label=which)
            ax.set_ylim(0)
            ax.grid(alpha=0.3)
            ax.spines[["top", "right"]].set_visible(False)
            if shape == SHAPES[0]:
                ax.set_title(title, fontsize=10)
            if shape == SHAPES[-1]:
                ax.set_xlabel("slant of the light / deg")
        line[0].set_ylabel(shape)
    grid[0][0].legend(frameon=False, title="shadow handling", fontsize=8, title_fontsize=8)
    figure.savefig(file, dpi=80)


def draw_maps(reports: Path, slant: float, file: Path) -> None:
    """Per shape: under LED 1, the shadows, and the errors with and without on one scale."""
    figure = Figure(figsize=(11, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"Light slanted by {slant:g}°", fontsize=11)
    grid = figure.subplots(len(SHAPES), 4)
    titles = ("under LED 1", "shadows per pixel", "error with handling", "error without")
    for line, shape in zip(grid, SHAPES, strict=True):
        rows = [row for row in read_rows(reports / shape) if row.sweep[SLANT] == slant]
        found = {handling(row): views(reports / shape, row) for row in rows}
        truth = found["with"]["truth"].array
        errors = [found[which]["height"].array - truth for which in COLOURS]
        end = float(np.percentile(np.abs(errors), 99.5))
        line[0].imshow(found["with"]["image"].array[0], cmap="gray", vmin=0)
        dark = np.bitwise_count(found["with"]["truth_shadow"].array)
        line[1].imshow(dark, cmap="magma_r", vmin=0, vmax=4)
        for ax, error in zip(line[2:], errors, strict=True):
            picture = ax.imshow(error, cmap="RdBu_r", vmin=-end, vmax=end)
        figure.colorbar(picture, ax=line[3], label="mm", extend="both")
        for ax, title in zip(line, titles, strict=True):
            ax.set_axis_off()
            if shape == SHAPES[0]:
                ax.set_title(title, fontsize=10)
    figure.savefig(file, dpi=80)


def main() -> None:
    reports, pictures = Path(sys.argv[1]), Path(sys.argv[2])
    pictures.mkdir(parents=True, exist_ok=True)
    print_tables(reports)
    draw_curves(reports, pictures / "ablation_slants.png")
    for slant in SLANTS_DEG:
        draw_maps(reports, slant, pictures / f"ablation_{slant:g}.png")


if __name__ == "__main__":
    main()
