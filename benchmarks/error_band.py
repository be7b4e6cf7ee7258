"""Print, as Markdown, how much of captures lies in the 90 % band of `precise`.

    python benchmarks/error_band.py [--rigs far near middle]
    python benchmarks/error_band.py --raytraced             # rigs of ../shared/data, and a summary
    python benchmarks/error_band.py --raytraced --blur 0.8  # rigs in the hand, through a lens

Simulated rigs and shapes are other ones than those of the ray-traced captures.  The surface is
rendered three times finer than the camera's pixels and averaged, so that edges are mixed as a
camera mixes them; the truth is the height in the middle of a pixel.  Of the ray-traced ones, those
that constants were chosen on and those left out are summed up apart; teapots are left out, as their
images are not those of the stated shape.
"""

import argparse
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import accuracy
import numpy as np
import real_film

from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.capture.write_capture import write_capture
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.slope.height_slopes import height_slopes

FINE = 3
BALL = {"radius_mm": 7.0, "rise_mm": 3.0}
SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "raytraced"
CHOSEN_ON = tuple(accuracy.PIXEL_MM)
SOFT, RIGID = ("sphere_film", "corner_film", "cat_film", "teapot_film"), ("sphere", "cat")
HERE = {"": Place("error_band", 0, 0, "shape")}


class Rig(NamedTuple):
    slant_deg: float
    distance_mm: float
    azimuth_deg: float
    pixel_mm: float
    size: tuple[int, int]
    bits: int


RIGS = {
    "far": Rig(30.0, 300.0, 20.0, 0.08, (320, 240), 8),
    "near": Rig(36.0, 45.0, 70.0, 0.06, (320, 240), 8),
    "middle": Rig(24.0, 90.0, 33.0, 0.05, (400, 300), 12),
}
# name: shape, its settings, and those of the press if it is pressed into the film
SHAPES: dict[str, tuple[str, dict[str, Any], dict[str, Any] | None]] = {
    "cone, pressed": ("cone", {"radius_mm": 4.0, "rise_mm": 1.6}, {}),
    "pyramid, pressed": ("pyramid", {}, {}),
    "letters, pressed": ("text", {"text": "ok", "rise_mm": 0.5}, {"skin_mm": 0.2}),
    "teapot, pressed": ("teapot", {"length_mm": 13.0}, {"skin_mm": 0.15}),
    "ball, pressed": ("ball", {"radius_mm": 6.0, "rise_mm": 1.5}, {}),
    "ball": ("ball", {"radius_mm": 4.2, "rise_mm": 3.4}, None),
    "hemisphere": ("ball", {"radius_mm": 3.6, "rise_mm": 3.6}, None),
    "teapot": ("teapot", {"length_mm": 13.0}, None),
    "cone": ("cone", {"radius_mm": 2.6, "rise_mm": 4.0}, None),
    "pyramid": ("pyramid", {"inradius_mm": 3.0, "rise_mm": 3.5}, None),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rigs", nargs="+", default=list(RIGS), choices=list(RIGS))
    parser.add_argument("--raytraced", action="store_true", help="rigs of a ray tracer instead")
    parser.add_argument("--blur", type=float, help="px, a Gaussian that those are seen through")
    given = parser.parse_args()
    if given.raytraced:
        with tempfile.TemporaryDirectory() as folder:
            raytraced(given.blur, Path(folder))
        return
    print("| rig | shape | RMSE / px | in the 90 % band |\n| --- | --- | --- | --- |")
    for name in given.rigs:
        with tempfile.TemporaryDirectory() as folder:
            report(name, RIGS[name], Path(folder))


def raytraced(blur: float | None, folder: Path) -> None:
    """Every shape on every rig, and how many of the rows are as they should be."""
    print("| rig |", " | ".join(SOFT + RIGID), "|")
    print("| --- |" + " --- |" * len(SOFT + RIGID))
    families = {"chosen on": CHOSEN_ON if blur is None else (), "left out": real_film.RIGS}
    for family, rigs in families.items():
        data, found = SHARED, []
        if blur is not None:
            lens = partial(real_film.blurred, width_px=blur)
            data = real_film.seen_by(lens, SHARED, list(rigs), folder / "blurred")
        for name in rigs:
            here = data / name
            if name in CHOSEN_ON:
                calibration = accuracy.calibrate(here, folder / f"{name}.npz")
            else:
                calibration = real_film.calibrate_rig(here, folder)
            bands = {}
            for shape in SOFT + RIGID:
                if (here / shape).is_dir():
                    metrics = run("precise", capture=here / shape, calibration=calibration)
                    bands[shape] = metrics["metrics"]["in_90_percent_band"]
            cells = (f"{bands[shape]:.0f}" if shape in bands else "" for shape in SOFT + RIGID)
            print(f"| {name} |", " | ".join(cells), "|", flush=True)
            found += [band for shape, band in bands.items() if shape != "teapot_film"]
        if found:
            right = sum(85 <= band <= 95 for band in found)
            print(f"{family}: {right} of {len(found)} within 85 to 95 %, least {min(found):.0f} %")


def report(name: str, rig: Rig, folder: Path) -> None:
    """Calibrate a rig with a ball, and measure every shape."""
    ball, flat, calibration = (folder / part for part in ("ball", "flat", "cal.npz"))
    simulate(rig, "ball", BALL, None, ball, seed=1)
    simulate(rig, "flat", {}, None, flat, seed=2)
    given = {"capture": ball, "flat": flat, "out": calibration}
    run("calibrate", **given, ball_radius_mm=7.0, pixel_size_mm=rig.pixel_mm)
    for seed, (title, shape) in enumerate(SHAPES.items(), start=3):
        capture = folder / title
        simulate(rig, *shape, capture, seed)
        found = run("precise", capture=capture, calibration=calibration)["metrics"]
        row = f"{found['rmse_px']:.3g} | {found['in_90_percent_band']:.1f}"
        print(f"| {name} | {title} | {row} |", flush=True)


def run(graph: str, **given: Any) -> Any:
    (result,) = open_pipeline(graph, given, sinks="out" in given).items()
    return result


def simulate(
    rig: Rig,
    shape: str,
    settings: dict[str, Any],
    press: dict[str, Any] | None,
    out: Path,
    seed: int,
) -> None:
    """Render a shape finely, average over the camera's pixels, expose and write."""
    graph = read_graph("simulate" if press is None else "simulate_press")
    size = {name: f"${name}" for name in ("width_px", "height_px", "pixel_size_mm")}
    changes: list[dict[str, Any]] = [
        {"replace": "shape", "op": f"shape_{shape}", "settings": {**size, **settings}},
        {"set": "lights", "settings": {"first_azimuth_deg": rig.azimuth_deg}},
    ]
    if press:
        changes.append({"set": "film", "settings": press})
    for change in changes:
        graph = apply_patch(graph, change, HERE)
    height = "shape.height" if press is None else "film"
    parts = {"light": "scene.light", "labels": "scene.labels", "height": height, "lights": "lights"}
    width, rows = rig.size
    given = {
        "out": out,
        "slant_deg": rig.slant_deg,
        "distance_mm": rig.distance_mm,
        "width_px": width * FINE,
        "height_px": rows * FINE,
        "pixel_size_mm": rig.pixel_mm / FINE,
    }
    (scene,) = open_pipeline(replace(graph, outputs=parts), given, sinks=False).items()
    mean = scene["light"].reshape(-1, rows, FINE, width, FINE).mean(axis=(2, 4))
    image = expose(mean.astype(np.float32), bits=rig.bits, seed=seed).image
    middle = np.s_[FINE // 2 :: FINE, FINE // 2 :: FINE]
    z, labels = (np.ascontiguousarray(scene[part][middle]) for part in ("height", "labels"))
    slope = height_slopes(z, rig.pixel_mm).slope
    given_to = image, z, slope, rig.pixel_mm, labels, scene["lights"]
    write_capture(*given_to, folder=out, bits=rig.bits)


if __name__ == "__main__":
    main()
