"""A real sensor: calibrate on the left half of a grooved part, reconstruct the right half.

    python benchmarks/groove.py ../shared/data/real/groove_6led out

Four of the six LEDs.  The reference is the sensor vendor's own height map: independent, not
metrological.  There is no untouched frame, so both graphs estimate it.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from one_run import run

PIXEL_MM = 0.0274581
MIDDLE = 308
LEDS = [2, 3, 5, 6]


def images(node: str, crop: list[int]) -> dict[str, object]:
    """Changes of the node that reads the images."""
    return {f"{node}.files": "image{:02}", f"{node}.leds": LEDS, f"{node}.crop": crop}


def main(data: Path, out: Path) -> None:
    reference = np.load(data / "heightmap_mm.npy")
    height, width = reference.shape
    left, right = [0, 0, MIDDLE, height], [MIDDLE, 0, width, height]
    calibration = out / "groove.npz"
    run(
        "calibrate_known_shape_no_flat",
        {**images("taken", left), "shape.crop": left},
        capture=str(data),
        height=str(data / "heightmap_mm.npy"),
        pixel_size_mm=PIXEL_MM,
        out=str(calibration),
    )
    found = run(
        "paper_no_flat",
        images("frames", right),
        capture=str(data),
        calibration=str(calibration),
        out=str(out / "right"),
    )["height"]
    truth = reference[:, MIDDLE:]
    report(found, truth)
    draw(found, truth, out / "groove.png")


def report(found: np.ndarray, truth: np.ndarray) -> None:
    rows, columns = np.mgrid[: truth.shape[0], : truth.shape[1]]
    plane = np.stack([np.ones(truth.size), columns.ravel(), rows.ravel()], axis=1)
    error = (found - truth).ravel().astype(np.float64)
    level = error - plane @ np.linalg.lstsq(plane, error, rcond=None)[0]
    slope, expected = (np.gradient(z / PIXEL_MM, axis=1) for z in (found, truth))
    print(f"range of the reference          {1e3 * np.ptp(truth):6.1f} um")
    print(f"height RMSE, mean set to zero   {1e3 * error.std():6.1f} um")
    print(f"height RMSE, plane taken off    {1e3 * level.std():6.1f} um")
    print(f"slope RMS of the reference      {expected.std():6.4f}")
    print(f"slope RMSE                      {(slope - expected).std():6.4f}")
    print(
        f"correlation of the slopes       {np.corrcoef(slope.ravel(), expected.ravel())[0, 1]:6.4f}"
    )


def draw(found: np.ndarray, truth: np.ndarray, file: Path) -> None:
    figure = Figure(figsize=(10, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 3)
    profiles = {"found": found - np.median(found), "reference": truth - np.median(truth)}
    for axis, (title, z) in zip(axes, profiles.items(), strict=False):
        picture = axis.imshow(1e3 * z, vmin=-100, vmax=100, cmap="viridis")
        axis.set(title=f"{title} / um")
    figure.colorbar(picture, ax=axes[:2])
    row = truth.shape[0] // 2
    for title, z in profiles.items():
        axes[2].plot(np.arange(z.shape[1]) * PIXEL_MM, 1e3 * z[row], label=title, linewidth=1)
    axes[2].set(xlabel="x / mm", ylabel="height / um", title="section through the middle row")
    axes[2].legend()
    figure.savefig(file, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
