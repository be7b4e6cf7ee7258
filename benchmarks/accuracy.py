"""Print, as Markdown, how accurate the shipped graphs are on captures of known shape.

    python benchmarks/accuracy.py [--ablations | --limits] [--data FOLDER]

Every rig is calibrated once, from one ball press and its flat frame; nothing is tuned per
capture.  The true shadows are those that the true height casts from the true LEDs.
"""

import argparse
import json
import sys
import tempfile
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from one_run import row, run

from tactograph.nodes import Labels
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.evaluate.evaluate_shadow import evaluate_shadow
from tactograph.nodes.shadow.cast_shadows import cast_shadows

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "data"
PIXEL_MM = {"far28": 1 / 14, "near33": 1 / 14, "far28_vga16": 1 / 28}
SHAPES = ("sphere_film", "cat_film", "sphere", "cat")
GRAPHS = ("paper_no_shadow", "paper", "reconstruct", "precise")
ABLATIONS = (
    "precise",
    "precise_no_constraints",
    "precise_no_reweighting",
    "precise_no_cliffs",
    "precise_no_settling",
    "precise_no_pixel_mean",
    "precise_no_feedback",
    "precise_one_pass",
    "precise_image_labels",
)
FIGURES = {
    "RMSE / px": "rmse_px",
    "largest / px": "max_error_px",
    "over 10 % of the peak": "over_10_percent",
    "shadow IoU, all LEDs": "shadow_iou",
    "the worst LED": "worst_iou",
    "in the 90 % band": "in_90_percent_band",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=DATA, help="a folder of rigs")
    parser.add_argument("--ablations", action="store_true", help="precise without each part")
    parser.add_argument("--limits", action="store_true", help="labels from the exact height")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        calibrations = {
            rig: calibrate(arguments.data / rig, Path(folder) / f"{rig}.npz")
            for rig in rigs_in(arguments.data)
        }
        table = ablations if arguments.ablations else limits if arguments.limits else accuracy
        table(arguments.data, calibrations)


def rigs_in(data: Path) -> list[str]:
    """The rigs whose captures are there; tests/data has two of three."""
    found = [rig for rig in PIXEL_MM if (data / rig).is_dir()]
    return found or sys.exit(f"none of {', '.join(PIXEL_MM)} is in {data}")


def calibrate(rig: Path, file: Path) -> Path:
    """Calibrate a rig with its ball press and flat frame."""
    run(
        "calibrate",
        capture=rig / "calibration",
        flat=rig / "flat",
        ball_radius_mm=7.0,
        pixel_size_mm=PIXEL_MM[rig.name],
        out=file,
    )
    return file


def measure(graph: str, capture: Path, calibration: Path) -> dict[str, float]:
    """Run a graph on a capture; its metrics."""
    result = run(graph, capture=capture, calibration=calibration)
    labels = evaluate_shadow(result["shadow"], true_shadows(capture))
    each = [value for name, value in labels.items() if name.startswith("shadow_iou/")]
    return dict(result["metrics"]) | labels | ({"worst_iou": min(each)} if each else {})


@cache
def true_shadows(capture: Path) -> Labels:
    """The shadows that the true height casts from the true LEDs."""
    lights = json.loads((capture / "scene.json").read_text())["lights_mm"]
    return shadows_of_the_truth(capture, np.array(lights, np.float32))


def shadows_of_the_truth(capture: Path, lights: np.ndarray) -> Labels:
    """The shadows that the true height casts from LEDs at `lights`, by rays in steps of a third."""
    height = cv2.resize(
        np.load(capture / "truth_height_mm.npy").astype(np.float32), None, fx=3, fy=3
    )
    fine = cast_shadows(height, lights, PIXEL_MM[capture.parent.name] / 3, attached=True)
    return np.ascontiguousarray(fine[1::3, 1::3])


def accuracy(data: Path, calibrations: dict[str, Path]) -> None:
    """Every graph on every capture, all figures."""
    row("capture", "graph", *FIGURES)
    row(*["---"] * (2 + len(FIGURES)))
    for rig, calibration in calibrations.items():
        for shape in SHAPES:
            for graph in GRAPHS:
                found = measure(graph, data / rig / shape, calibration)
                figures = [number(found.get(name)) for name in FIGURES.values()]
                row(f"{rig} {shape}", graph, *figures)


def ablations(data: Path, calibrations: dict[str, Path]) -> None:
    """RMSE and largest error in px, a row per graph, a column per capture."""
    captures = [(rig, shape) for rig in calibrations for shape in SHAPES]
    row("graph", *(f"{rig} {shape}" for rig, shape in captures))
    row(*["---"] * (1 + len(captures)))
    for graph in ABLATIONS:
        cells = []
        for rig, shape in captures:
            found = measure(graph, data / rig / shape, calibrations[rig])
            cell = f"{number(found['rmse_px'])} / {number(found['max_error_px'])}"
            if "shadow_iou" in found:
                cell += f" / {number(found['shadow_iou'])}"
            cells.append(cell)
        row(graph, *cells)


def limits(data: Path, calibrations: dict[str, Path]) -> None:
    """What is left of the labels' errors with the exact height, and with exact LEDs."""
    names = [f"shadow_iou/led{k}" for k in range(1, 5)]
    row("capture", "height, LEDs", *(f"LED {k}" for k in range(1, 5)))
    row(*["---"] * 6)
    for rig, calibration in calibrations.items():
        lights = read_calibration(file=calibration).film.lights
        for shape in SHAPES:
            capture = data / rig / shape
            exact = evaluate_shadow(shadows_of_the_truth(capture, lights), true_shadows(capture))
            found = measure("precise", capture, calibration)
            row(f"{rig} {shape}", "as found", *(number(found.get(name)) for name in names))
            row("", "height exact", *(number(exact.get(name)) for name in names))


def number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


if __name__ == "__main__":
    main()
