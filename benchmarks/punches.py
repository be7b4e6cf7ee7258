"""Print, as Markdown, how deep flat punches come out on a simulated one-shot sensor.

    python benchmarks/punches.py

Three colours light the film at once.  It is matt, or coated: then it is glossy, lights itself, and
the lens blurs by 0.7 px.  Balls calibrate, large or small ones; punches have walls that are steeper
than those.  What is printed is the middle of the plateau found less the true one, in um and per
cent, and the contacts that are found.
"""

import tempfile
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from tactograph.graph import load
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.shape_ball import shape_ball

PIXEL_MM, ROWS, COLUMNS = 0.1, 120, 160
CANVAS = {"width_px": COLUMNS, "height_px": ROWS, "pixel_size_mm": PIXEL_MM}
BALLS_MM, PRESSES = {"balls of 3 mm": (3.0, 0.5, 1.0), "of 1.2 mm": (1.2, 0.5, 1.0)}, 24
"""Radius, and least and largest depth of a press."""
HALF_MM, INNER_MM, TURN = 2.0, 1.4, 0.3
"""Half a punch's side, half that of the plateau's middle, and its turn."""
DEPTHS_MM, WALLS_DEG = (0.25, 0.5, 0.75, 1.0), (60, 75, 90)
BLUR_PX = 0.7
COATS: dict[str, dict[str, float]] = {
    "matt": {},
    "coated": {"albedo": 0.6, "coat_alpha": 0.25, "refractive_index": 1.5},
}
Y, X = PIXEL_MM * (np.indices((ROWS, COLUMNS)) - (np.array([ROWS, COLUMNS])[:, None, None] - 1) / 2)
U, V = (np.cos(TURN) * X + np.sin(TURN) * Y, np.cos(TURN) * Y - np.sin(TURN) * X)
INSIDE = HALF_MM - np.maximum(np.abs(U), np.abs(V))
"""Distance from the edge of a punch's plateau."""
Map = NDArray[Any]


def main() -> None:
    warnings.simplefilter("ignore")
    print(
        "| film | calibrated by | depth / mm | " + " | ".join(f"{w} deg" for w in WALLS_DEG) + " |"
    )
    print("| --- | --- | --- |" + " --- |" * len(WALLS_DEG))
    for film, coat in COATS.items():
        for balls, ball in BALLS_MM.items():
            with tempfile.TemporaryDirectory() as folder:
                rows(f"| {film} | {balls}", coat, ball, Path(folder))


def rows(title: str, coat: dict[str, float], ball: tuple[float, ...], folder: Path) -> None:
    see(np.zeros_like(X), coat, folder / "flat", 0)
    rng = np.random.default_rng(1)
    for number in range(PRESSES):
        at = (float(rng.uniform(-5, 5)), float(rng.uniform(-3.5, 3.5)))
        depth = float(rng.uniform(*ball[1:]))
        shape = shape_ball(radius_mm=ball[0], rise_mm=depth, offset_mm=at, **CANVAS).height
        see(covered(shape), coat, folder / "balls" / f"{number:02}", number + 1)
    calibration = folder / "cal.npz"
    given = {"captures": folder / "balls", "flat": folder / "flat", "ball_radius_mm": ball[0]}
    run("calibrate_presses", **given, pixel_size_mm=PIXEL_MM, out=calibration)
    for depth in DEPTHS_MM:
        cells = []
        for wall in WALLS_DEG:
            film = covered(punch(depth, wall))
            touch = see(film, coat, folder / f"{depth}_{wall}", 99)
            known = {"capture": touch, "calibration": calibration, "accept_contradictions": True}
            found = run("gelsight_mini", **known)
            middle = np.maximum(np.abs(U), np.abs(V)) < INNER_MM
            off = float(np.median(found["height"][middle]) - np.median(film[middle]))
            contacts = int(found["contact"].max())
            cells.append(f"{1e3 * off:.0f}, {100 * off / depth:.0f} %, {contacts}")
        print(f"{title} | {depth} | " + " | ".join(cells) + " |", flush=True)


def punch(depth: float, wall_deg: float) -> Map:
    if wall_deg == 90:
        return np.where(INSIDE >= 0, depth, 0.0)
    return np.clip(depth + INSIDE * np.tan(np.radians(wall_deg)), 0, depth)


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
        (seen,) = pipeline.items()
    planes = seen.outputs["light"]
    if coat:
        planes = gaussian_filter(planes, (0, BLUR_PX, BLUR_PX))
    image = np.rint(255 * expose(planes, seed=seed).image).astype(np.uint8)
    for name in ("film", "rest"):
        (folder / f"{name}.npy").unlink()
    cv2.imwrite(str(folder / "colours.png"), image.transpose(1, 2, 0))
    return folder


def run(graph: str, **given: Any) -> Any:
    (result,) = open_pipeline(graph, given, sinks=graph == "calibrate_presses").items()
    return result


if __name__ == "__main__":
    main()
