"""What more presses, more flat frames and following the light's drift are worth.

    python benchmarks/calibration.py [--data FOLDER]

Three tables: LEDs placed by one ball, by another, and by both; one flat frame against the
mean of eight (simulated, LEDs 55 mm away); LEDs that have faded since the flat frame.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from accuracy import DATA, PIXEL_MM, measure, number
from one_run import row, run

from tactograph.graph import load
from tactograph.nodes.capture.read_capture import Layout

RIGS = ("far28", "near33")
SHAPES = ("sphere_film", "cat_film", "cat")
FADES = {
    "none": (1.0, 1.0, 1.0, 1.0),
    "LED 1 by 1 %": (0.99, 1.0, 1.0, 1.0),
    "LEDs 1, 2 by 5, 3 %": (0.95, 0.97, 1.0, 1.0),
}
GRAPHS = ("reconstruct_no_levelling", "reconstruct", "precise_no_levelling", "precise")
FLATS = 8
NEAR: dict[str, Any] = {"slant_deg": 33.0, "distance_mm": 55.0}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=DATA, help="a folder of rigs")
    data: Path = parser.parse_args().data
    with tempfile.TemporaryDirectory() as folder:
        calibrations = presses(data, Path(folder))
        flats(Path(folder))
        fades(data, calibrations)


def presses(data: Path, folder: Path) -> dict[str, Path]:
    """The RMSE of soft presses and a cat, by the presses that the LEDs were placed with."""
    row("rig", "presses", "held out / deg", "held out / um", *(f"{s} / px" for s in SHAPES))
    row(*["---"] * (4 + len(SHAPES)))
    first: dict[str, Path] = {}
    for rig in RIGS:
        balls = {"7 mm": ("calibration", 7.0), "5 mm": ("sphere", 5.0)}
        both = folder / f"{rig}_both"
        both.mkdir()
        for name, (capture, _) in balls.items():
            (both / name.replace(" ", "_")).symlink_to((data / rig / capture).resolve())
        tried = {n: (data / rig / capture, (r,)) for n, (capture, r) in balls.items()}
        for name, (capture, radii) in (tried | {"both": (both, (5.0, 7.0))}).items():
            file = folder / f"{rig}_{name.replace(' ', '_')}.npz"
            first.setdefault(rig, file)
            params = {"ball_radius_mm": radii, "pixel_size_mm": PIXEL_MM[rig]}
            result = run("calibrate", capture=capture, flat=data / rig / "flat", out=file, **params)
            held = [result["quality"].get(f"heldout_{f}") for f in ("normal_deg", "height_um")]
            errors = [measure("precise", data / rig / s, file)["rmse_px"] for s in SHAPES]
            row(rig, name, *map(number, held), *map(number, errors))
    return first


def flats(folder: Path) -> None:
    """Soft press of a ball, `precise`, calibrated with one flat frame and with many."""
    print()
    row("flat frames", "reconstruct / px", "precise / px")
    row("---", "---", "---")
    run("simulate", out=folder / "ball", radius_mm=7.0, rise_mm=3.5, **NEAR)
    run("simulate_press", out=folder / "touch", seed=5, **NEAR)
    for seed in range(FLATS):
        run("simulate_flat", out=folder / "flats" / str(seed), seed=100 + seed, **NEAR)
    for name, flat in (("1", folder / "flats" / "0"), (str(FLATS), folder / "flats")):
        file = folder / f"flat{name}.npz"
        params = {"ball_radius_mm": 7.0, "pixel_size_mm": 0.07142857, "out": file}
        run("calibrate", capture=folder / "ball", flat=flat, **params)
        touch = {"capture": folder / "touch", "calibration": file}
        found = [run(g, out=folder / g, **touch)["metrics"] for g in ("reconstruct", "precise")]
        row(name, *(number(metrics["rmse_px"]) for metrics in found))


def fades(data: Path, calibrations: dict[str, Path]) -> None:
    """LEDs fade after the flat frame: RMSE in px on a soft press, and on the film at rest."""
    print()
    row("rig", "faded", "graph", "sphere_film / px", "film at rest / px")
    row(*["---"] * 5)
    for rig, calibration in calibrations.items():
        images = {n: Layout().images(data / rig / n) for n in ("sphere_film", "flat")}
        truth = np.load(data / rig / "sphere_film" / "truth_height_mm.npy")
        for name, gains in FADES.items():
            gain = np.array(gains, np.float32)[:, None, None]
            for graph in GRAPHS:
                pipeline = load(graph, calibration=str(calibration))
                touch = pipeline(frames=images["sphere_film"] * gain)["height"] - truth
                rest = pipeline(frames=images["flat"] * gain)["height"]
                errors = [np.sqrt(np.mean(e * e)) / PIXEL_MM[rig] for e in (touch, rest)]
                row(rig, name, graph, *(number(float(e)) for e in errors))


if __name__ == "__main__":
    main()
