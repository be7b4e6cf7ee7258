"""Print, as Markdown, how deep flat punches come out on a simulated one-shot sensor.

    python benchmarks/punches.py

Three colours light the film at once.  It is matt, or coated: then it is glossy, lights itself, and
the lens blurs by 0.7 px.  Balls calibrate, large or small ones, alone or with two squares of known
depth; squares and triangles of four depths and three walls are then measured.  A row says how far
the middles of the plateaus are off, how many are within 3 % or 20 um, within two of the deviations
that are stated, and are found as one contact.
"""

import tempfile
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from one_run import run
from scipy.ndimage import gaussian_filter

from tactograph.graph import load
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.shape_ball import shape_ball

PIXEL_MM, ROWS, COLUMNS = 0.1, 120, 160
CANVAS = {"width_px": COLUMNS, "height_px": ROWS, "pixel_size_mm": PIXEL_MM}
BALLS_MM, PRESSES = {"balls of 3 mm": (3.0, 0.5, 1.0), "balls of 1.2 mm": (1.2, 0.5, 1.0)}, 24
"""Radius, and least and largest depth of a press."""
TURN, INNER_MM = 0.3, 0.6
"""A punch's turn, and distance from its edge at which its plateau's middle begins."""
SQUARE_MM, TRIANGLE_MM = 2.0, 1.6
"""Distance of the sides from the middle."""
DEPTHS_MM, WALLS_DEG = (0.25, 0.5, 0.75, 1.0), (60, 75, 90)
KNOWN = {"0": (0.5, 75), "1": (1.0, 75)}
"""Depth and wall of the squares that calibrate."""
MAX_OFF_MM, MAX_OFF_SHARE = 0.02, 0.03
BLUR_PX = 0.7
COATS: dict[str, dict[str, float]] = {
    "matt": {},
    "coated": {"albedo": 0.6, "coat_alpha": 0.25, "refractive_index": 1.5},
}
Y, X = PIXEL_MM * (np.indices((ROWS, COLUMNS)) - (np.array([ROWS, COLUMNS])[:, None, None] - 1) / 2)
Map = NDArray[Any]


def within(mm: float, azimuths: NDArray[Any]) -> Map:
    """Distance from the nearest of sides that lie as far from the middle, in these azimuths."""
    return np.min([mm - np.cos(a) * X - np.sin(a) * Y for a in azimuths + TURN], axis=0)


INSIDE = {
    "square": within(SQUARE_MM, np.pi / 2 * np.arange(4)),
    "triangle": within(TRIANGLE_MM, 2 * np.pi / 3 * np.arange(3)),
}


def main() -> None:
    warnings.simplefilter("ignore")
    print(
        "| film | calibrated by | measured | off: root mean square, worst / um | per cent "
        "| within 3 % or 20 um | within two stated deviations | one contact |\n| " + "--- | " * 8
    )
    for film, coat in COATS.items():
        for balls, ball in BALLS_MM.items():
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                press_all(coat, ball, folder)
                for more in ({}, {"punches": folder / "known", "punch_depth_mm": [0.5, 1.0]}):
                    calibrate(folder, ball[0], more)
                    by = balls + " and two squares" * bool(more)
                    for shape in INSIDE:
                        row(f"| {film} | {by} | {shape}s", coat, shape, folder)


def press_all(coat: dict[str, float], ball: tuple[float, ...], folder: Path) -> None:
    """Write what calibrates: the film at rest, balls, and the squares of known depth."""
    see(np.zeros_like(X), coat, folder / "flat", 0)
    rng = np.random.default_rng(1)
    for number in range(PRESSES):
        at = (float(rng.uniform(-5, 5)), float(rng.uniform(-3.5, 3.5)))
        depth = float(rng.uniform(*ball[1:]))
        shape = shape_ball(radius_mm=ball[0], rise_mm=depth, offset_mm=at, **CANVAS).height
        see(covered(shape), coat, folder / "balls" / f"{number:02}", number + 1)
    for name, (depth, wall) in KNOWN.items():
        see(covered(punch("square", depth, wall)), coat, folder / "known" / name, 98)


def calibrate(folder: Path, ball_mm: float, more: dict[str, Any]) -> None:
    params = {"captures": folder / "balls", "flat": folder / "flat", "ball_radius_mm": ball_mm}
    run("calibrate_presses", **params, **more, pixel_size_mm=PIXEL_MM, out=folder / "cal.npz")


def row(title: str, coat: dict[str, float], shape: str, folder: Path) -> None:
    """Measure every depth and wall of a shape."""
    off, depths, stated, alone = [], [], [], 0
    for depth in DEPTHS_MM:
        for wall in WALLS_DEG:
            film = covered(punch(shape, depth, wall))
            place = folder / f"{shape}_{depth}_{wall}"
            touch = place if place.exists() else see(film, coat, place, 99)
            known = {"capture": touch, "calibration": folder / "cal.npz"}
            found = run("gelsight_mini", **known, accept_contradictions=True)
            middle = INSIDE[shape] > INNER_MM
            off.append(np.median(found["height"][middle]) - np.median(film[middle]))
            stated.append(np.median(found["error"][middle]))
            depths.append(depth)
            alone += int(found["contact"].max()) == 1
    away, share = np.abs(off), np.abs(off) / depths
    good = int(np.sum((away <= MAX_OFF_MM) | (share <= MAX_OFF_SHARE)))
    sure, of = int(np.sum(away <= 2 * np.array(stated))), len(off)
    um, percent = (
        f"{np.sqrt(np.mean(e**2)):.0f}, {e.max():.0f}" for e in (1e3 * away, 100 * share)
    )
    print(f"{title} | {um} | {percent} | {good} of {of} | {sure} | {alone} |", flush=True)


def punch(shape: str, depth: float, wall_deg: float) -> Map:
    if wall_deg == 90:
        return np.where(INSIDE[shape] >= 0, depth, 0.0)
    return np.clip(depth + INSIDE[shape] * np.tan(np.radians(wall_deg)), 0, depth)


def covered(shape: Map) -> Map:
    return press(shape.astype(np.float32), PIXEL_MM, reach_mm=0.15, skin_mm=0.03)


def see(film: Map, coat: dict[str, float], folder: Path, seed: int) -> Path:
    """Write the colour image of a film."""
    folder.mkdir(parents=True)
    for name, height in (("film", film), ("rest", 0 * film)):
        np.save(folder / f"{name}.npy", height.astype(np.float32))
    lamps = {"count": 3, "slant_deg": 40.0, "distance_mm": 25.0, "first_azimuth_deg": 45.0}
    nodes: dict[str, Any] = {
        "pixel": {"op": "pixel_size", "with": {"mm": PIXEL_MM}},
        "leds": {"op": "light_ring", "with": lamps},
    }
    for name in ("film", "rest"):
        nodes[name] = {"op": "read_height", "with": {"file": str(folder / f"{name}.npy")}}
        lit = {"height": name, "pixel": "pixel", "lights": "leds"}
        nodes[f"{name}_lit"] = {"op": "render", "in": lit, "with": coat}
    light = "film_lit.light"
    if coat:
        lit = {"height": "film", "pixel": "pixel", "lights": "leds", "light": light}
        nodes["all"] = {"op": "interreflect", "in": lit | {"rest": "rest_lit.light"}, "with": coat}
        light = "all"
    with load({"format": 1, "nodes": nodes, "outputs": {"light": light}}) as pipeline:
        (result,) = pipeline.items()
    planes = result.outputs["light"]
    if coat:
        planes = gaussian_filter(planes, (0, BLUR_PX, BLUR_PX))
    image = np.rint(255 * expose(planes, seed=seed).image).astype(np.uint8)
    for name in ("film", "rest"):
        (folder / f"{name}.npy").unlink()
    cv2.imwrite(str(folder / "colours.png"), image.transpose(1, 2, 0))
    return folder


if __name__ == "__main__":
    main()
