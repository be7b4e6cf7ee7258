"""Print, as Markdown, how often the shadow labels of `precise` are right, stated and found.

    python benchmarks/label_confidence.py [--data FOLDER]
    python benchmarks/label_confidence.py --fit

The true shadows are those that the true height casts from the true LEDs; a pixel is right if
the labels of all its LEDs are.  ``--fit`` finds the coefficients of `shadow_confidence`, by
likelihood, on the simulated captures of `error_band.py` that have shadows.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from accuracy import DATA, SHAPES, calibrate, rigs_in, true_shadows
from error_band import BALL, RIGS, SHAPES as SIMULATED, rendered, simulate
from numpy.typing import NDArray
from one_run import row, run
from scipy.optimize import minimize

from tactograph.graph.files.read_graph import read_graph
from tactograph.nodes.shadow.cast_shadows import cast_shadows
from tactograph.nodes.shadow.shadow_confidence import shadow_confidence

BOUNDS = (0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 1.0)
SHADOWED = ("ball", "hemisphere", "teapot", "cone", "teapot, pressed")
COEFFICIENTS = ("base_odds", "light_odds", "edge_odds", "near_edge_odds", "contradicted_odds")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=DATA, help="a folder of rigs")
    parser.add_argument("--fit", action="store_true", help="find the coefficients")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.fit:
            fit(Path(folder))
        else:
            table(arguments.data, Path(folder))


def table(data: Path, folder: Path) -> None:
    """How many pixels of a stated confidence are right, over the ray-traced captures."""
    stated, right = [], []
    for rig in rigs_in(data):
        calibration = calibrate(data / rig, folder / f"{rig}.npz")
        for shape in SHAPES:
            capture = data / rig / shape
            found = run("precise", capture=capture, calibration=calibration)
            stated.append(found["confidence"].ravel())
            right.append((found["shadow"] == true_shadows(capture)).ravel())
    reliability(np.concatenate(stated), np.concatenate(right))


def reliability(stated: NDArray[Any], right: NDArray[Any]) -> None:
    row("stated", "pixels", "stated, mean / %", "right / %")
    row(*["---"] * 4)
    for low, high in pairwise(BOUNDS):
        there = (stated >= low) & (stated < high if high < 1 else stated <= 1)
        if there.any():
            shares = (f"{100 * plane[there].mean():.3g}" for plane in (stated, right))
            row(f"{low:g} to {high:g}", str(there.sum()), *shares)


def fit(folder: Path) -> None:
    """The likeliest coefficients on simulated captures."""
    graph = read_graph("precise")
    inputs = graph.nodes["relabel.label_confidence"].inputs
    graph = replace(graph, outputs=inputs)
    known, right = [], []
    for name, rig in RIGS.items():
        ball, flat, calibration = (folder / name / part for part in ("press", "flat", "cal.npz"))
        simulate(rig, rendered(rig, "ball", BALL, None), ball, seed=1)
        simulate(rig, rendered(rig, "flat", {}, None), flat, seed=2)
        params = {"capture": ball, "flat": flat, "out": calibration}
        run("calibrate", **params, ball_radius_mm=7.0, pixel_size_mm=rig.pixel_mm)
        for seed, title in enumerate(SHADOWED, start=3):
            capture = folder / name / "captures" / title
            simulate(rig, rendered(rig, *SIMULATED[title]), capture, seed)
            found = run(graph, capture=capture, calibration=calibration)
            leds = json.loads((capture / "scene.json").read_text())["lights_mm"]
            height = np.load(capture / "truth_height_mm.npy").astype(np.float32)
            truth = cast_shadows(height, np.array(leds, np.float32), rig.pixel_mm, attached=True)
            known.append({port: found[port] for port in inputs})
            right.append(found["shadow"] == truth)

    def loss(values: NDArray[Any]) -> float:
        fitted = dict(zip(COEFFICIENTS, map(float, values), strict=True))
        total = 0.0
        for captured, truth in zip(known, right, strict=True):
            chance = shadow_confidence(**captured, **fitted).astype(np.float64)
            total -= np.log(np.clip(np.where(truth, chance, 1 - chance), 1e-12, 1)).sum()
        return total

    start = [shadow_confidence.parameters[name].default for name in COEFFICIENTS]
    limits = [(0.01, 20)] * len(start)
    found = minimize(loss, start, bounds=limits, method="L-BFGS-B", options={"eps": 1e-2})
    row("coefficient", "likeliest")
    row("---", "---")
    for name, value in zip(COEFFICIENTS, found.x, strict=True):
        row(name, f"{value:.2f}")


if __name__ == "__main__":
    main()
