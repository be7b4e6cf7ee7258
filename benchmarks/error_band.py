"""Print, as Markdown, how much of captures lies in the 90 % band of `precise`.

    python benchmarks/error_band.py [--rigs far near middle]
    python benchmarks/error_band.py --raytraced             # rigs of ../shared/data, and a summary
    python benchmarks/error_band.py --raytraced --blur 0.8  # rigs in the hand, through a lens
    python benchmarks/error_band.py --new 6 --seed 1        # rigs and touches that chance makes
    python benchmarks/error_band.py --new 6 --touches 3     # three times as many of each kind

Simulated rigs and shapes are other ones than those of the ray-traced captures.  The surface is
rendered three times finer than the camera's pixels and averaged, so that edges are mixed as a
camera mixes them; the truth is the height in the middle of a pixel.  Of the ray-traced ones, those
that constants were chosen on and those left out are summed up apart; teapots are left out, as their
images are not those of the stated shape.  A new rig is one
in the hand whose LEDs, coat, albedo, pupil and blur chance draws; its film has one albedo, and its
exposure leaves no pixel of a press saturated, which `calibrate` warns of.  Two presses of a ball
and the pupil's height calibrate it.  A kind of its touches is one row, the mean of their shares and
the least, as the pixels of one touch err together.  A row therefore scatters even if all
errors are stated exactly.  Last, each kind over all rigs: the mean of the rows with its standard
error, and the geometric mean of stated over actual errors, root mean squares of a touch.
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
from one_run import run

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
NEW_BALL_MM = 6.0
BRIGHTEST = 0.95
"""Share of full scale of the brightest light of a press on a new rig, where it would be more."""


class Rig(NamedTuple):
    slant_deg: float
    distance_mm: float
    azimuth_deg: float
    pixel_mm: float
    size: tuple[int, int]
    bits: int
    flaws: dict[str, float] | None = None
    """Params of `simulate_hand`; None: a matt film far from the camera."""
    exposure: float = 1.0
    """By which all light is multiplied."""


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
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--raytraced", action="store_true", help="rigs of a ray tracer")
    parser.add_argument("--blur", type=float, help="px, a Gaussian that those are seen through")
    instead.add_argument("--new", type=int, default=0, help="so many rigs that chance makes")
    parser.add_argument("--seed", type=int, default=1, help="of the first of those")
    parser.add_argument("--touches", type=int, default=1, help="so many times as many of each kind")
    options = parser.parse_args()
    if options.new:
        new_rigs(range(options.seed, options.seed + options.new), options.touches)
        return
    if options.raytraced:
        with tempfile.TemporaryDirectory() as folder:
            raytraced(options.blur, Path(folder))
        return
    print("| rig | shape | RMSE / px | in the 90 % band |\n| --- | --- | --- | --- |")
    for name in options.rigs:
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


def new_rigs(seeds: range, times: int) -> None:
    """Every kind of touch on rigs that chance makes, the pixels of a kind together."""
    kinds = list(drawn_touches(np.random.default_rng(0)))
    print("| rig |", " | ".join(kinds), "|")
    print("| --- |" + " --- |" * len(kinds))
    rows, ratios = {kind: [] for kind in kinds}, {kind: [] for kind in kinds}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        rig = drawn_rig(rng)
        with tempfile.TemporaryDirectory() as folder:
            found = touches_by_kind(rig, rng, times, Path(folder))
        bands = {kind: [touch.band for touch in found[kind]] for kind in kinds}
        cells = (f"{np.mean(each):.0f} % ({min(each):.0f})" for each in bands.values())
        flaws = ", ".join(f"{name} {value:.2g}" for name, value in (rig.flaws or {}).items())
        leds = f"LEDs at {rig.slant_deg:.0f} degrees, {rig.distance_mm:.0f} mm"
        print(f"| {seed}: {leds}; {flaws} |", " | ".join(cells), "|", flush=True)
        for kind in kinds:
            rows[kind].append(float(np.mean(bands[kind])))
            ratios[kind] += [touch.ratio for touch in found[kind]]
    means = (f"{pooled(rows[kind])}, {np.exp(np.log(ratios[kind]).mean()):.2f}" for kind in kinds)
    print("| all: in the band, stated over actual |", " | ".join(means), "|")
    every = np.concatenate([*rows.values()])
    right = ((every >= 85) & (every <= 95)).sum()
    print(f"{right} of {every.size} within 85 to 95 %, least {every.min():.0f} %")


def pooled(rows: list[float]) -> str:
    """The mean of a kind's rows with its standard error, which the scatter of the rigs tells."""
    if len(rows) == 1:
        return f"{rows[0]:.0f} %"
    return f"{np.mean(rows):.1f} ± {np.std(rows, ddof=1) / np.sqrt(len(rows)):.1f} %"


def drawn_rig(rng: np.random.Generator) -> Rig:
    """A rig in the hand; each flaw is there in two of three."""
    flaws = {
        "led_size_mm": rng.uniform(1, 4),
        "coat_alpha": rng.uniform(0.12, 0.35),
        "bounce_albedo": rng.uniform(0.4, 0.8),
        "camera_mm": rng.uniform(50, 150),
        "blur_px": rng.uniform(0.2, 0.9),
    }
    there = {name: float(size * (rng.random() < 2 / 3)) for name, size in flaws.items()}
    slant = float(rng.uniform(28, 42))
    distance = float(np.exp(rng.uniform(np.log(45), np.log(300))))
    return Rig(slant, distance, float(rng.uniform(0, 90)), 0.8 / 7, (200, 150), 8, there)


def drawn_touches(rng: np.random.Generator) -> dict[str, list[Any]]:
    """Touches by kind: shape, its settings, and those of the film."""

    def placed(shape: str, soft: bool = True, **settings: Any) -> Any:
        settings["offset_mm"] = rng.uniform(-3, 3, 2).tolist()
        if shape not in ("ball", "cone"):
            settings["angle_deg"] = float(rng.uniform(0, 360))
        return shape, settings, {} if soft else {"reach_mm": 0, "skin_mm": 0}

    def size(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    walls = [{"rise": size(0.1, 0.5), "wall_deg": size(20, 50)} for _ in range(8)]
    groove = {"period_mm": 9.0, "duty": 2 / 3, "middle": "groove"}
    step = {"count": 1, "tread_mm": 6.0}
    return {
        "soft touches": [
            placed("ball", radius_mm=size(3, 7), rise_mm=size(0.5, 2)),
            placed("cone", radius_mm=size(3, 5), rise_mm=size(0.8, 1.6)),
            placed("pyramid", inradius_mm=size(3, 4), rise_mm=size(1, 2.5)),
            placed("text", text="ok", rise_mm=size(0.3, 0.8)),
            placed("cat", length_mm=size(8, 14), rise_mm=size(1, 2.5)),
            placed("ball", radius_mm=size(2, 4), rise_mm=size(0.5, 1)),
        ],
        "half balls": [
            placed("ball", False, radius_mm=radius, rise_mm=radius)
            for radius in rng.uniform(1.5, 3, 3).tolist()
        ],
        "grooves": [
            placed("grating", **groove, rise_mm=w["rise"], wall_deg=w["wall_deg"])
            for w in walls[:4]
        ],
        "steps": [
            placed("steps", **step, step_mm=w["rise"], wall_deg=w["wall_deg"]) for w in walls[4:]
        ],
    }


class Touch(NamedTuple):
    band: float
    ratio: float
    """Of the root mean squares of stated and actual errors."""


def touches_by_kind(
    rig: Rig, rng: np.random.Generator, times: int, folder: Path
) -> dict[str, list[Touch]]:
    """Calibrate a rig; return the touches of each kind, of which those of one time come first."""

    def seed() -> int:
        return int(rng.integers(2**31))

    presses, flat, calibration = (folder / part for part in ("presses", "flat", "cal.npz"))
    rigid = {"reach_mm": 0, "skin_mm": 0}
    for number, place in enumerate(([0.0, 0.0], [-5.0, 3.0])):
        ball = {"radius_mm": NEW_BALL_MM, "rise_mm": 2.8, "offset_mm": place}
        press = rendered(rig, "ball", ball, rigid)
        if not number:
            rig = rig._replace(exposure=min(1.0, BRIGHTEST / float(press[0].max())))
        simulate(rig, press, presses / str(number), seed())
    simulate(rig, rendered(rig, "flat", {}, {}), flat, seed())
    params: dict[str, Any] = {"capture": presses, "flat": flat, "out": calibration}
    if camera := (rig.flaws or {}).get("camera_mm"):
        params["camera_mm"] = camera
    run("calibrate", **params, ball_radius_mm=NEW_BALL_MM, pixel_size_mm=rig.pixel_mm)
    by_kind: dict[str, list[Touch]] = {}
    for _ in range(times):
        for kind, touches in drawn_touches(rng).items():
            for touch in touches:
                one = by_kind.setdefault(kind, [])
                capture = folder / f"{kind} {len(one)}"
                simulate(rig, rendered(rig, *touch), capture, seed())
                found = run("precise", capture=capture, calibration=calibration)
                metrics = found["metrics"]
                one.append(Touch(metrics["in_90_percent_band"], metrics["stated_over_actual"]))
    return by_kind


def report(name: str, rig: Rig, folder: Path) -> None:
    """Calibrate a rig with a ball, and measure every shape."""
    ball, flat, calibration = (folder / part for part in ("ball", "flat", "cal.npz"))
    simulate(rig, rendered(rig, "ball", BALL, None), ball, seed=1)
    simulate(rig, rendered(rig, "flat", {}, None), flat, seed=2)
    params = {"capture": ball, "flat": flat, "out": calibration}
    run("calibrate", **params, ball_radius_mm=7.0, pixel_size_mm=rig.pixel_mm)
    for seed, (title, shape) in enumerate(SHAPES.items(), start=3):
        capture = folder / title
        simulate(rig, rendered(rig, *shape), capture, seed)
        found = run("precise", capture=capture, calibration=calibration)["metrics"]
        row = f"{found['rmse_px']:.3g} | {found['in_90_percent_band']:.1f}"
        print(f"| {name} | {title} | {row} |", flush=True)


def simulate(rig: Rig, scene_light: tuple[Any, Any], out: Path, seed: int) -> None:
    """Expose and write what `rendered` returned."""
    mean, scene = scene_light
    image = expose(mean * np.float32(rig.exposure), bits=rig.bits, seed=seed).image
    middle = np.s_[FINE // 2 :: FINE, FINE // 2 :: FINE]
    z, labels = (np.ascontiguousarray(scene[part][middle]) for part in ("height", "labels"))
    slope = height_slopes(z, rig.pixel_mm).slope
    given_to = image, z, slope, rig.pixel_mm, labels, scene["lights"]
    write_capture(*given_to, folder=out, bits=rig.bits)


def rendered(
    rig: Rig, shape: str, settings: dict[str, Any], press: dict[str, Any] | None
) -> tuple[Any, Any]:
    """Render a shape finely; return its light averaged over the camera's pixels, and the scene."""
    hand = rig.flaws is not None
    name = "simulate_hand" if hand else "simulate" if press is None else "simulate_press"
    graph = read_graph(name)
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
    if hand:
        parts |= {"light": "lens", "labels": "view.labels", "height": "view.height"}
    width, rows = rig.size
    params = {
        "out": None,
        "slant_deg": rig.slant_deg,
        "distance_mm": rig.distance_mm,
        "width_px": width * FINE,
        "height_px": rows * FINE,
        "pixel_size_mm": rig.pixel_mm / FINE,
    }
    if rig.flaws is not None:
        params |= {**rig.flaws, "blur_px": rig.flaws["blur_px"] * FINE, "lens_at_corner": 0.0}
        if albedo := rig.flaws["bounce_albedo"]:
            params["albedo"] = albedo
    (scene,) = open_pipeline(replace(graph, outputs=parts), params, sinks=False).items()
    mean = scene["light"].reshape(-1, rows, FINE, width, FINE).mean(axis=(2, 4))
    return mean.astype(np.float32), scene


if __name__ == "__main__":
    main()
