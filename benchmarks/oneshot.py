"""A one-shot colour sensor: calibrate on four fifths of the presses, measure the others.

    python benchmarks/oneshot.py ../shared/data/real/gelsight_mini_balls out

Measured by the shipped graph `gelsight_mini`; calibrated by the nodes of `calibrate_presses`,
called one by one so that each ball is looked for only once (it is, in each press alone).
The truth is the ball itself, where it touches: its radius
is known, its circle found by `find_ball`, and its centre then refined with the map of the
other presses; the second row leaves the centres as `find_ball` gave them.  Every press
counts, also those that a calibration of all presses would leave out.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph import Provenance
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.calibrate.rating.pressed_ball import PressedBall
from tactograph.rings.oneshot.nodes.file.write_press_calibration import write_press_calibration
from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.presses.find_presses import find_presses
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import (
    Bench,
    MapFit,
    fit_reflectance_map,
)
from tactograph.rings.oneshot.nodes.presses.level_presses import level_presses
from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses

RADIUS_MM, PIXEL_MM, FOLD_COUNT = 6.31 / 2, 0.0634, 5
UNKNOWN = Provenance({}, None, [], {}, {}, [], [])
DRAWN_PRESSES = ("25", "13", "2")
HEAD = (
    "| circles of the held-out presses | normal error, mean / median / worst (degrees) "
    "| height RMSE, mean / median / worst (um) | per cent of the cap, mean / median |"
)


def chosen(presses: Path, names: list[str], into: Path) -> Path:
    """A folder that shows only these presses."""
    into.mkdir()
    for name in names:
        (into / name).symlink_to((presses / name).resolve())
    return into


def measure(captures: Path, calibration: Path, out: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    params = {"capture": captures, "calibration": calibration, "out": out}
    results = open_pipeline("gelsight_mini", params).items()
    return [(result.outputs["slope"], result.outputs["height"]) for result in results]


def main(data: Path, out: Path) -> None:
    folder = data / "6.310mm"
    captured, flat, names, *_ = read_presses(folder=folder, flat=data / "background.png")
    image = level_presses(captured, flat)
    ball = find_presses(image, flat, names, PIXEL_MM, radius_mm=RADIUS_MM).circle
    bench = Bench.of(image, flat, RADIUS_MM, PIXEL_MM, degree=4)
    rows: dict[str, list[tuple[float, float, float]]] = {"refined": [], "as found": []}
    measured: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    at_rest: list[tuple[float, float]] = []
    departures: list[float] = []
    for fold in range(FOLD_COUNT):
        training = ball.copy()
        training[fold::FOLD_COUNT, 2] = 0
        fit = fit_reflectance_map(image, flat, names, training, PIXEL_MM, radius_mm=RADIUS_MM)
        calibration = out / f"fold{fold}.npz"
        write_press_calibration(
            flat, PIXEL_MM, fit.reflectance, {}, "", file=calibration, provenance=UNKNOWN
        )
        with tempfile.TemporaryDirectory() as room:
            test = chosen(folder, names[fold::FOLD_COUNT], Path(room) / "test")
            results = measure(test, calibration, Path(room) / "out")
        reflectance = fit.reflectance.astype(np.float64)
        held = range(fold, len(names), FOLD_COUNT)
        for i, (slope, height) in zip(held, results, strict=True):
            found = ball[i].astype(np.float64)
            circle = bench.refine_center(reflectance, found, i, fit.rim, steps=6)
            at_rest.append(resting(height, circle))
            departures.append(rendered(image[i], flat, circle, bench.radius, fit))
            for row, truth in (("refined", circle), ("as found", found)):
                rows[row].append(PressedBall(truth, bench.radius, PIXEL_MM).errors(slope, height))
            measured[names[i]] = height, circle
        print(f"fold {fold + 1} of {FOLD_COUNT} done, {time.process_time():.0f} s", file=sys.stderr)
    report(rows)
    spread, tilt = 1e3 * np.mean(at_rest, axis=0)
    print(f"\nfilm at rest: {spread:.1f} um from its mean, tilted by {tilt:.1f} um over the frame")
    middle, most, share = (
        np.median(departures),
        np.percentile(departures, 90),
        np.mean(np.array(departures) <= 1.5),
    )
    whole = np.sqrt(np.mean(np.square(departures)))
    print(
        f"rendered from the ball's shape: off by {middle:.2f} of the film's noise and texture at "
        f"rest (median), nine presses of ten below {most:.2f}; {100 * share:.0f} % at most 1.5; "
        f"of all together {whole:.2f}"
    )
    for name, figures in zip(measured, rows["refined"], strict=True):
        print(f"press {name}: {figures[0]:.2f} degrees, {figures[1]:.1f} um", file=sys.stderr)
    draw({name: measured[name] for name in DRAWN_PRESSES}, bench, out / "oneshot.png")


def resting(height: np.ndarray, circle: np.ndarray) -> tuple[float, float]:
    """Standard deviation and tilt over the frame, in mm, beyond 2.5 radii of the contact."""
    y, x = np.mgrid[: height.shape[0], : height.shape[1]]
    far = np.hypot(x - circle[0], y - circle[1]) > 2.5 * circle[2]
    plane = np.stack([x[far], y[far], np.ones(far.sum())], axis=1)
    p, q, _ = np.linalg.lstsq(plane, height[far], rcond=None)[0]
    return float(height[far].std()), float(np.hypot(p * height.shape[1], q * height.shape[0]))


def rendered(
    press: np.ndarray, flat: np.ndarray, circle: np.ndarray, radius: float, fit: MapFit
) -> float:
    """Residual of the light that the map gives the ball, over what the film at rest varies by."""
    y, x = np.indices(press.shape[1:]).astype(np.float64)
    away = np.hypot(x - circle[0], y - circle[1]) / circle[2]
    slope, height = PressedBall(circle, radius, PIXEL_MM).shape(x.ravel(), y.ravel())
    planes = np.float32([*slope, height + fit.rim]).reshape(3, *x.shape)
    off = (press - flat * mapped_light(planes[:2], planes[2], fit.reflectance))[:, away < 0.85]
    varies = (press / flat - 1)[:, away > 2.5].std(axis=1)
    at_rest = varies[:, None] * flat[:, away < 0.85]
    return float(np.sqrt(np.mean(off**2) / np.mean(at_rest**2)))


def report(rows: dict[str, list[tuple[float, float, float]]]) -> None:
    print(HEAD)
    print("| --- | --- | --- | --- |")
    for name, figures in rows.items():
        mean, middle, worst = (f(figures, axis=0) for f in (np.mean, np.median, np.max))
        print(
            f"| {name} | {mean[0]:.2f} / {middle[0]:.2f} / {worst[0]:.2f} "
            f"| {mean[1]:.1f} / {middle[1]:.1f} / {worst[1]:.1f} "
            f"| {mean[2]:.2f} / {middle[2]:.2f} |"
        )


def draw(measured: dict[str, tuple[np.ndarray, np.ndarray]], bench: Bench, file: Path) -> None:
    """The held-out heights, and their sections through the ball beside the ball's own."""
    figure = Figure(figsize=(4 * len(measured), 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(measured), squeeze=False)
    for (name, (height, circle)), (above, below) in zip(measured.items(), axes.T, strict=True):
        picture = above.imshow(1e3 * height, cmap="viridis", vmin=-100, vmax=900)
        above.set(title=f"press {name}, held out / um", xlabel="x / px", ylabel="y / px")
        x = np.arange(height.shape[1])
        inside = np.abs(x - circle[0]) < circle[2]
        row = height[int(np.clip(round(circle[1]), 0, height.shape[0] - 1))]
        ball = np.sqrt(bench.radius**2 - (x[inside] - circle[0]) ** 2) * PIXEL_MM
        ball += (row[inside] - ball).mean()
        below.plot(x * PIXEL_MM, 1e3 * row, label="found", linewidth=1)
        below.plot(x[inside] * PIXEL_MM, 1e3 * ball, "--", label="ball", linewidth=1)
        below.set(xlabel="x / mm", ylabel="height / um")
        below.legend()
    figure.colorbar(picture, ax=axes[0])
    figure.savefig(file, dpi=90)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
