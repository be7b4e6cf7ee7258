"""Print, as Markdown, how true heights of scans are by the light models that come with them.

    python benchmarks/scans.py
    python benchmarks/scans.py --only coin --pictures docs/pictures
    python benchmarks/scans.py --only speed     # on a machine that does nothing else

Balls: two grids on GelSight's OEM sensor, by the vendor's file alone and by a calibration that
starts from it and is fitted to the other grid.  Coin: on a handheld sensor; its field is what lies
flat, found by the height.  Grooves: rendered through the models of three sensors, and of two whose
coefficients differ from theirs by 5 %, with 1 % of noise.  Maps: how much of whole height maps lies
in the 90 % band where edges are sharp, rendered three times finer than pixels, and where a step
covers a part of the frame.  Models: what each of three sensors of one frame size leaves of the
others' light.  The captures belong to GelSight (sdkdemo, gssim).
"""

import argparse
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tactograph.graph import load
from tactograph.graph.run.result import Result
from tactograph.nodes import BAND_DEVIATIONS, Light, Metrics
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.drawing.new_picture import NewPicture
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.light.coarsen import coarsen
from tactograph.rings.metrology.nodes.scan.judge_light_model import judge_light_model
from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.light_model_slope import light_model_slope
from tactograph.rings.metrology.nodes.scan.read_light_model import ScanLight, read_light_model
from tactograph.rings.metrology.nodes.surface.filter_surface import form
from tactograph.rings.metrology.nodes.surface.measure_step import measure_step, step_profiles
from tactograph.rings.metrology.nodes.surface.plot_step import plot_step

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.one_run import row, run
from benchmarks.real_film import PIXEL_MM, RADIUS_MM, ROOT, measure
from rings.metrology.tests.scan.scans import groove_shape, lit, seen, write_scan

DATA = ROOT.parent / "shared/data/real"
GRIDS, SCANS = DATA / "gelsight_six_led", DATA / "gelsight_scans"
MODEL = SCANS / "oem/demo-calibration.yaml"
COIN, COIN_MODEL = SCANS / "handheld/japanese-coin-001", SCANS / "handheld/model-test1.yaml"
FIELD_MM, FIELD_RADIUS_MM = 0.015, 6.3
"""How far the coin's field lies from its plane at most, and how far it reaches."""
DEVICES = "series1_1587_M6G0", "series2_2EF6_4JNW", "modulus1600_570C_TRLJ"
CELL_PX = 16
Plane = NDArray[np.float64]
WARM_ROUNDS, ROUNDS = 3, 11
KNOWN_UM, UNKNOWN_UM, SMALLER = 507, 246, 4
GROOVE_CROP, GROOVE_MM, WALL_DEG = (32, 900, 2432, 1060), 0.5, 30
MAP_CROP, FINE, MAP_PIXEL_MM = (900, 700, 1500, 1100), 3, 0.007
"""Sensors of other pixels show a surface of as many pixels."""
GROOVES, GROOVE_DEPTHS_MM, GROOVE_WALLS_DEG = 6, (0.1, 0.5), (20, 45)
"""Grooves of each sensor, and between what their depths and walls are drawn."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", choices=list(PARTS), action="append", help="a part of it")
    parser.add_argument("--pictures", type=Path, help="draw coin and groove into this folder")
    options = parser.parse_args()
    if not GRIDS.is_dir() or not SCANS.is_dir():
        raise SystemExit(f"there are no captures in {DATA}")
    for part in options.only or PARTS:
        PARTS[part](options.pictures)
        print()


def head(*names: str) -> None:
    row(*names)
    row(*["---"] * len(names))


def show_balls(_: Path | None) -> None:
    head("grid", "light", "normals / deg", "cap RMS / um", "film between / um")
    with tempfile.TemporaryDirectory() as folder:
        for name, other in (("balls_1", "balls_2"), ("balls_2", "balls_1")):
            size = {"capture": GRIDS / name}
            alone = run("reconstruct_scan", model=MODEL, pixel_size_mm=PIXEL_MM, **size)
            file = Path(folder) / f"{other}.npz"
            run(
                "calibrate_scan",
                capture=GRIDS / other,
                flat=GRIDS / "flat",
                start=MODEL,
                ball_radius_mm=RADIUS_MM,
                ball_pitch_mm=1.0,
                out=file,
            )
            fitted = run("reconstruct", calibration=file, **size)
            for light, found in (("vendor's file alone", alone), (f"fitted to {other}", fitted)):
                grid = measure(found, GRIDS / f"{name}.csv", 1)
                numbers = f"{grid.normal_deg:.2f}", f"{grid.cap_um:.2f}", f"{grid.film_um:.1f}"
                row(name, light, *numbers)


def show_coin(pictures: Path | None) -> None:
    height = run("reconstruct_scan", capture=COIN, model=COIN_MODEL)["height"]
    relief, field = coin(height)
    print(f"the coin's field, {field.mean():.0%} of the frame, departs from a plane by")
    rows, columns = relief.shape
    middle = relief[rows // 4 : rows // 2, columns // 3 : columns // 2]
    top = np.median(middle[middle > 2 * FIELD_MM])
    print(f"{1e3 * relief[field].std():.1f} um, its relief is {1e3 * top:.0f} um high")
    if pictures:
        draw(relief, pictures / "scan_coin.png")


def show_grooves(pictures: Path | None) -> None:
    """Grooves of random depth and walls: rows of one groove share its error, so grooves count."""
    head("sensor", "off / um", "furthest off / um", "stated / um", "in the 90 % band", "rows in it")
    rng, table = np.random.default_rng(0), []
    with tempfile.TemporaryDirectory() as folder:
        files = [SCANS / "devices" / f"{device}.yaml" for device in DEVICES]
        files += [altered(file, Path(folder), seed) for seed, file in enumerate(files[:2])]
        for file in files:
            grooves = []
            for _ in range(GROOVES):
                depth, wall = rng.uniform(*GROOVE_DEPTHS_MM), rng.uniform(*GROOVE_WALLS_DEG)
                _, figures, held = groove(file, int(rng.integers(2**31)), depth, wall)
                off = figures["step_depth_um"] - 1e3 * depth
                stated = figures["step_uncertainty_um"]
                inside = abs(off) < BAND_DEVIATIONS * stated
                grooves.append((off, stated, inside, held.mean()))
            table += grooves
            groove_row(file.stem, grooves)
    groove_row("all", table)
    if pictures:
        found, figures, _ = groove(files[0], 0, GROOVE_MM, WALL_DEG)
        plot_step(found["height"], found["pixel"], figures, file=pictures / "step_profile.png")


def show_maps(_: Path | None) -> None:
    """Grooves, a cap and steps by the models of three sensors, with 1 % of noise."""
    head("surface", "off / um", "film at rest off / um", "stated / um", "in the 90 % band")
    surfaces: dict[str, tuple[str, Callable[[Plane, Plane], Plane]]] = {
        "groove of 100 um, walls of 30 degrees": (
            "flat",
            lambda x, _: -ramp(0.1, 30, 0.4 - abs(x)),
        ),
        "groove of 300 um, walls of 45 degrees": (
            "flat",
            lambda x, _: -ramp(0.3, 45, 0.4 - abs(x)),
        ),
        "cap of 200 um": ("flat", lambda x, y: np.maximum(ball(1.3, x, y) - 1.1, 0)),
    }
    for level, share in product(("flat", "plane"), (0.25, 0.4)):
        edge = (share - 0.5) * MAP_PIXEL_MM * (MAP_CROP[2] - MAP_CROP[0])
        name = f"step of 300 um over {share:.0%}, `level={level}`"
        surfaces[name] = level, lambda x, _, edge=edge: ramp(0.3, 30, edge - x)
    for name, (level, surface) in surfaces.items():
        maps = [rendered(SCANS / f"devices/{device}.yaml", surface, level) for device in DEVICES]
        *numbers, inside = np.transpose(maps)
        spans = [f"{each.min():.2f} to {each.max():.2f}" for each in numbers]
        row(name, *spans, " ".join(f"{share:.0%}" for share in inside))


def ramp(height: float, wall_deg: float, beyond: Plane) -> Plane:
    """A step with sharp edges, by the way in mm beyond its middle."""
    return height * np.clip(0.5 + beyond * np.tan(np.radians(wall_deg)) / height, 0, 1)


def ball(radius: float, x: Plane, y: Plane) -> Plane:
    return np.sqrt(np.maximum(radius**2 - x * x - y * y, 0))


def rendered(
    file: Path, surface: Callable[[Plane, Plane], Plane], level: str
) -> tuple[float, float, float, float]:
    """By how much a map and its film at rest are off, what is stated, and what lies in the band."""
    sensor = read_light_model(file=file, crop=MAP_CROP)
    model, pixel, images = sensor.model, MAP_PIXEL_MM, 0.0
    size = len(model.v), len(model.u)
    y, x = (pixel * (i - (n - 1) / 2) for i, n in zip(np.indices(size), size, strict=True))
    # A pixel's light is the mean over the pixel, whose normals are those of the surface there.
    for down, right in product(np.arange(1 - FINE, FINE, 2) / (2 * FINE), repeat=2):
        u, v, half = x + right * pixel, y + down * pixel, pixel / FINE / 2
        p = (surface(u + half, v) - surface(u - half, v)) / (2 * half)
        q = (surface(u, v + half) - surface(u, v - half)) / (2 * half)
        images = images + lit(p, q, model) / FINE**2
    noise = 1 + 0.01 * np.random.default_rng(1).normal(size=images.shape)
    frames = np.clip(images * noise, 0, 1).astype(np.float32)
    found = load("reconstruct_scan", model=file, crop=list(MAP_CROP), level=level)(frames=frames)
    z = surface(x, y) * (sensor.pixel_size / pixel)
    off, at_rest = 1e3 * (found["height"] - z), z == z[0, -1]
    stated = 1e3 * found["error"]
    sizes = (float(np.sqrt(np.mean(each**2))) for each in (off, off[at_rest], stated))
    return (*sizes, float(np.mean(np.abs(off) < BAND_DEVIATIONS * stated)))


def groove_row(sensor: str, grooves: list[tuple[float, ...]]) -> None:
    off, stated, *shares = np.transpose(grooves)
    numbers = off.mean(), abs(off).max(), stated.mean()
    row(sensor, *(f"{n:.2f}" for n in numbers), *(f"{each.mean():.0%}" for each in shares))


def altered(file: Path, folder: Path, seed: int) -> Path:
    """The light model of a sensor that is not there: each coefficient differs by 5 %."""
    rng, other = np.random.default_rng(seed), folder / f"{file.stem}_altered.yaml"

    def alter(found: re.Match[str]) -> str:
        values = np.fromstring(found[1], sep=",")
        values *= 1 + 0.05 * rng.normal(size=values.size)
        return f"values: [{', '.join(f'{value:.9g}' for value in values)}]"

    other.write_text(re.sub(r"values: \[(.*?)\]", alter, file.read_text()))
    shutil.copy(file.with_suffix(".png"), folder)
    return other


def show_models(_: Path | None) -> None:
    """What models leave of light that is not theirs; above 2 % they are refused."""
    alike = [SCANS / "devices" / f"{device}.yaml" for device in DEVICES[:2]] + [COIN_MODEL]
    models = {file.stem: read_light_model(file=file, cell=CELL_PX) for file in alike}
    oem = read_light_model(file=MODEL, cell=CELL_PX).model
    lit = {f"dome, {name}": seen(dome(of), of.model, of.pixel_size) for name, of in models.items()}
    (capture,) = read_capture(folder=COIN)
    lit["coin, model-test1"] = coarsen(capture.image, factor=CELL_PX)
    head("light of", "by", "left", "brightness")
    for light, (name, of) in product(lit, models.items()):
        judged(light, name, lit[light], of.model)
    (capture,) = read_capture(folder=GRIDS / "balls_1")
    lights = coarsen(capture.image, factor=CELL_PX)
    dimmed = np.where(np.arange(6) == 2, 0.7, 1).astype(np.float32)[:, None, None]
    for how, light in {
        "balls_1": lights,
        "balls_1, LEDs 1 and 2 exchanged": lights[[1, 0, 2, 3, 4, 5]],
        "balls_1, order turned by one": lights[[1, 2, 3, 4, 5, 0]],
        "balls_1, order reversed": lights[::-1],
        "balls_1, order 3, 2, 1, 6, 5, 4": lights[[2, 1, 0, 5, 4, 3]],
        "balls_1, LED 3 at 0.7": lights * dimmed,
    }.items():
        judged(how, MODEL.stem, light, oem)


def judged(how: str, by: str, light: Light, model: LightModel) -> None:
    found = light_model_slope(np.ascontiguousarray(light, np.float32), model)
    figures = judge_light_model(found, only_warn=True)
    residual, brightness = figures["model_residual"], figures["model_brightness"]
    row(how, by, f"{residual:.1%}", f"{brightness:.2f}")


def dome(sensor: ScanLight) -> NDArray[np.float32]:
    """A cap that fills the frame, with slopes up to 0.4 at its sides."""
    y, x = np.meshgrid(sensor.model.v, sensor.model.u, indexing="ij")
    side = sensor.pixel_size * min(len(sensor.model.u), len(sensor.model.v))
    return np.asarray(-0.4 * side * (x * x + y * y), np.float32)


def show_speed(_: Path | None) -> None:
    """Seconds of one scan, by the clock and of the processor: medians."""
    images = np.stack([ImageFile(GRIDS / f"balls_1/led{k}.png").read() for k in range(1, 7)])
    params = {"model": MODEL, "pixel_size_mm": PIXEL_MM}
    warm = load("reconstruct_scan", **params)
    head("six images of 5 megapixels", "clock / s", "processor / s")
    timed("in memory, to height and error", lambda: warm(frames=images))
    with tempfile.TemporaryDirectory() as folder:
        for number in range(WARM_ROUNDS + ROUNDS):
            (Path(folder) / f"scan{number:02}").symlink_to(GRIDS / f"balls_{1 + number % 2}")
        scans = load("reconstruct_scan", capture=folder, **params).items()
        timed("a stream of folders, to height and error", lambda: next(scans))
    print(f"\nload of the machine: {os.getloadavg()[0]:.1f}")


def timed(what: str, scan: Callable[[], object]) -> None:
    spent = []
    for _ in range(WARM_ROUNDS + ROUNDS):
        clock, processor = time.perf_counter(), time.process_time()
        scan()
        spent.append((time.perf_counter() - clock, time.process_time() - processor))
    row(what, *(f"{n:.2f}" for n in np.median(spent[WARM_ROUNDS:], axis=0)))


def coin(height: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The coin above the plane of its field, and the field, every fourth pixel."""
    z = height[::4, ::4]
    rows, columns = z.shape
    y, x = np.mgrid[:rows, :columns]
    pixel = 4 * read_light_model(file=COIN_MODEL).pixel_size
    near = np.hypot(x - 0.485 * columns, y - 0.46 * rows) * pixel < FIELD_RADIUS_MM
    above = z - np.median(z[near])
    for _ in range(10):
        close = near & (np.abs(above) < FIELD_MM)
        field = cv2.erode(close.astype(np.uint8), np.ones((7, 7))) > 0
        above = z - form(np.where(field, z, np.float32(np.nan)), 1)
    return above, field


def draw(relief: NDArray[np.float32], file: Path) -> None:
    figure = Figure(figsize=(6, 4.4), dpi=100, layout="constrained")
    axes = figure.subplots()
    picture = axes.imshow(1e3 * relief, vmin=-30, vmax=100, cmap="gray")
    axes.set(xticks=[], yticks=[])
    figure.colorbar(picture, label="height above the field / um")
    NewPicture(file).write(figure)


def show_known(_: Path | None) -> None:
    """Grooves of 246 um by models that are wrong, before and after one of 507 um settles them."""
    head("sensor", "walls / deg", "off / um", "stated / um", "settled: off / um", "stated / um")
    for device, wall in product(DEVICES, (WALL_DEG, 20, 40)):
        with tempfile.TemporaryDirectory() as folder:
            pairs = [settled(device, wall, seed, Path(folder)) for seed in range(3)]
        numbers = []
        for each in zip(*pairs, strict=True):
            numbers.append(max(abs(found["step_depth_um"] - UNKNOWN_UM) for found in each))
            numbers.append(np.mean([found["step_uncertainty_um"] for found in each]))
        row(device, f"{wall}", *(f"{n:.2f}" for n in numbers))


def settled(device: str, wall: float, seed: int, folder: Path) -> tuple[Metrics, Metrics]:
    """Figures of a groove by a device's model alone, and after a groove of known depth.

    The frame is a quarter of the device's.  The film departs from the model as film does: its
    slopes count 1.75 % more, as if the model's balls were 1 % smaller; it is 4.5 % brighter than
    the model's, at the bottom of the groove 9.7 %; every LED differs by 0.5 to 2 %, by terms of
    normal and position of its own.
    """
    text = (SCANS / "devices" / f"{device}.yaml").read_text()
    sizes = {"width": 1 / SMALLER, "height": 1 / SMALLER, "mmperpixel": SMALLER}
    for key, factor in sizes.items():
        (value,) = re.findall(rf"^{key}: *(.*)$", text, re.MULTILINE)
        text = text.replace(f"{key}: {value}", f"{key}: {float(value) * factor:g}", 1)
    model = folder / f"{device}.yaml"
    model.write_text(text)
    shutil.copy(SCANS / "devices" / f"{device}.png", folder)
    sensor, rng = read_light_model(file=model), np.random.default_rng(seed)
    shape, pixel = (len(sensor.model.v), len(sensor.model.u)), sensor.pixel_size
    wrong = rng.normal(0, 0.005, (6, 8))
    for name, depth, steep in (("known", KNOWN_UM, WALL_DEG), ("part", UNKNOWN_UM, wall)):
        z = groove_shape(depth / 1e3, steep, 2, shape, pixel)
        slope = np.stack(np.gradient(z.astype(float) / pixel))
        y, x = -slope / np.sqrt(1 + np.sum(slope**2, axis=0))
        u, v = np.meshgrid(sensor.model.u, sensor.model.v)
        terms = np.stack([3 * x, 3 * y, 3 * x * x, 3 * x * y, 3 * y * y, u, v, u * x])
        light = seen(1.0175 * z, sensor.model, pixel) * (1 + np.tensordot(wrong, terms, 1))
        light *= 1.045 - 0.052 * z / depth * 1e3
        light *= 1 + 0.01 * rng.normal(size=light.shape)
        write_scan(folder / name, np.clip(light, 0, 1).astype(np.float32), pixel=pixel)
    params = {"capture": folder / "part", "model": model, "cell_px": 8, "out": folder / "result"}
    known = {"step": folder / "known", "certified_um": (KNOWN_UM, 0.2)}
    figures = []
    for more in ({}, known):
        run("reconstruct_scan", **params, **more)
        figures.append(run("measure_step", height=folder / "result" / "height.npy")["step"])
    return figures[0], figures[1]


def groove(
    file: Path, noise_seed: int, depth: float, wall_deg: float
) -> tuple[Result, Metrics, NDArray[np.bool_]]:
    """A groove through a sensor's model, its figures, and the rows whose 90 % band holds it."""
    sensor = read_light_model(file=file, crop=GROOVE_CROP)
    x0, y0, x1, y1 = GROOVE_CROP
    z = groove_shape(depth, wall_deg, 3, (y1 - y0, x1 - x0), sensor.pixel_size)
    light = seen(z, sensor.model, sensor.pixel_size)
    noise = 1 + 0.01 * np.random.default_rng(noise_seed).normal(size=light.shape)
    images = np.clip((light * noise).astype(np.float32), 0, 1)
    found = load("reconstruct_scan", model=file, crop=list(GROOVE_CROP))(frames=images)
    measured = found["height"], sensor.pixel_size, found["error"]
    rows = step_profiles(*measured, along="x", edges=2)
    off, stated = (np.array([getattr(row, name) for row in rows]) for name in ("depth", "error"))
    return found, measure_step(*measured), abs(off - depth) < BAND_DEVIATIONS * stated


PARTS = {
    "balls": show_balls,
    "coin": show_coin,
    "grooves": show_grooves,
    "known": show_known,
    "maps": show_maps,
    "models": show_models,
    "speed": show_speed,
}


if __name__ == "__main__":
    main()
