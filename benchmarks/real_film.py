"""Print, as Markdown, how true heights are on a real film and on rigs as they are in the hand.

    python benchmarks/real_film.py                  # the real grid of balls, and the rigs
    python benchmarks/real_film.py --ablations      # reconstruct without each part of the film
    python benchmarks/real_film.py --only rigs      # or: real
    python benchmarks/real_film.py --only real --rendered --scale 4 --graphs reconstruct
    python benchmarks/real_film.py --only real --scale 4 --leds 6 --graphs precise
    python benchmarks/real_film.py --only real --exchanged --graphs reconstruct
    python benchmarks/real_film.py --only rigs --mosaic --rigs hand_ideal hand --graphs precise
    python benchmarks/real_film.py --only rigs --shapes sphere --blur 0.8 --graphs precise

The real sensor (GelSight bench sensor, six LEDs, grids of steel balls; gelsightinc/sdkdemo, MIT)
is calibrated with the first scan and measured on the second, or `--exchanged`, at full resolution
or, by `--scale`, at a part of it; of a graph that states an error the share of it that holds is
printed.  Each rig is calibrated with both ball presses, the grid on its film and the height of its
pupil, if it has one.  With `--mosaic` its camera has the colour of the LEDs in every second pixel
of every second row; with `--blur` a lens spreads every point by a Gaussian, and the noise is as it
was.
Long because one scan is judged in one way, as heights and, with `--rendered`, as images.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from tactograph.graph import load

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.one_run import row, run

ROOT = Path(__file__).resolve().parents[1]
PIXEL_MM, RADIUS_MM, PITCH_MM = 0.003404, 0.2475, 1.0
LEDS = {6: [1, 2, 3, 4, 5, 6], 4: [2, 3, 5, 6]}
CENTER_PX, CONTACT_PX = [1014.46, 1023.27], 65.0
"""The single ball that calibrates; of the second scan, the ball nearest to that place."""
SCANS = "balls_1", "balls_2"
SMOOTH_PX, INNER = 1.5, 0.85
ASTRAY_PX = 6
"""Normals that meet so far from a mark do not tell the ball's centre."""
SAME_CHIP = 4, 4
"""Both scans show one chip, whose balls differ in height.  Ball (i, j) of the second is ball
(4 + i, 4 - j) of the first."""
SCRATCHED = 0, 3
"""The ball of the second scan with a scratch, and with a glint under one LED."""
ASTRAY_BALL = 4.0
"""Median departures from the plane of all beyond which a ball is not seen alike by both scans."""
WITHIN_90 = 1.6449
"""Standard deviations of a normal distribution on either side that hold 90 %."""
INNER_SHARE, TEXTURE_PX = 0.8, 8.0
"""Share of the radius on which rendered images count; width of what counts as smooth film."""
BESIDE_REACH = 1.5
"""Film counts as such from so many radii from any ball."""
RIG_PIXEL_MM = 1 / 14
RIGS = (
    "hand_ideal",
    "hand_perspective",
    "hand_lens",
    "hand_discs",
    "hand_bounce",
    "hand_gloss",
    "hand",
)
SHAPES = ("sphere_film", "corner_film", "teapot_film", "cat_film")
GRAPHS = ("paper", "reconstruct", "precise")
ABLATIONS = (
    "reconstruct",
    "reconstruct_no_diffuse",
    "reconstruct_no_bounce",
    "reconstruct_no_lobe",
    "reconstruct_no_harmonics",
    "reconstruct_orthographic",
)


class Grid(NamedTuple):
    """Means over the marked balls, and over the film between all balls."""

    normal_deg: float
    cap_um: float
    film_um: float
    top_um: float
    """Standard deviation of the balls' tops from the plane that most lie in, worn ones left out."""
    tops_percent: float
    """By how much the same balls are higher, on average, than in the scan that calibrates."""
    band_percent: float
    """Of the pixels, whose cap, its mean taken out, lies in the 90 % band; NaN without an error."""
    seated_percent: float
    """The same for heights against spheres that stand as the other scan has them, but for a plane,
    as the chip lay otherwise there; both scans' errors count."""
    stated_ratio: float
    """Root mean squares of the stated error and of the departure from those spheres, divided."""
    stated_um: float
    """Median of the stated standard deviation on the balls."""
    alike: float
    """Correlation between both scans of what the balls' heights depart from a plane."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--only", choices=("real", "rigs"), help="a part of the tables")
    parser.add_argument("--leds", type=int, nargs="+", default=list(LEDS), choices=list(LEDS))
    parser.add_argument("--scale", type=int, default=1, help="pixels of a side put into one")
    parser.add_argument("--rigs", nargs="+", default=list(RIGS), choices=RIGS)
    parser.add_argument("--mosaic", action="store_true", help="rigs seen by a colour camera")
    parser.add_argument("--blur", type=float, help="px, a Gaussian that the rigs are seen through")
    parser.add_argument("--shapes", nargs="+", default=SHAPES, choices=(*SHAPES, "sphere"))
    parser.add_argument("--graphs", nargs="+", default=None)
    parser.add_argument("--ablations", action="store_true", help="without each part of the film")
    parser.add_argument("--exchanged", action="store_true", help="the other scan calibrates")
    parser.add_argument("--rendered", action="store_true", help="real scans against see_touch")
    options = parser.parse_args()
    graphs = options.graphs or (ABLATIONS if options.ablations else GRAPHS)
    with tempfile.TemporaryDirectory() as folder:
        if options.only != "rigs":
            data = options.data / "real/gelsight_six_led"
            rest = data, options.leds, graphs, Path(folder), options.scale
            if options.rendered:
                rendered_rows(*rest)
            else:
                real(*rest, *(SCANS[::-1] if options.exchanged else SCANS))
        if options.only != "real":
            rig_folder = options.data / "raytraced"
            if options.mosaic:
                rig_folder = seen_by(
                    through_a_mosaic, rig_folder, options.rigs, Path(folder) / "mosaic"
                )
            if options.blur:
                blur = partial(blurred, width_px=options.blur)
                rig_folder = seen_by(blur, rig_folder, options.rigs, Path(folder) / "blurred")
            rigs(rig_folder, options.rigs, options.shapes, graphs, Path(folder))


def real(
    data: Path,
    counts: list[int],
    graphs: tuple[str, ...],
    folder: Path,
    scale: int,
    first: str,
    second: str,
) -> None:
    """The grid of balls, calibrated with one ball and with a whole scan: the first one."""
    row(
        "LEDs",
        "calibrated with",
        "graph",
        "normals / deg",
        "cap RMS / um",
        "film / um",
        "tops / um",
        "tops, between scans / %",
        "in the band / %",
        "seated, in the band / %",
        "stated / actual",
        "stated / um",
        "balls alike",
    )
    row(*["---"] * 13)
    captures = _captures(data, folder, scale)
    marks = {scan: data / f"{scan}.csv" for scan in SCANS}
    places = _marked(marks[first], 1)[1]
    nearest = places[np.hypot(*(places - CENTER_PX).T).argmin()]
    centre = [float((c + 0.5) / scale - 0.5) for c in nearest]
    for count in counts:
        leds = LEDS[count]
        other = folder / f"other{count}.npz"
        stand: Seats = {}
        one = {"ball_center_px": centre, "ball_contact_px": CONTACT_PX / scale}
        for title, how in (("one ball", one), ("a scan", {"ball_pitch_mm": PITCH_MM})):
            file = folder / f"real{count}{len(how)}.npz"
            quality = _calibrated(captures, leds, scale, file, first, **how)
            chosen = f"{quality['film_heldout_deg']:.2f}"
            for graph in graphs:
                result, before = (
                    run(graph, {"frames.leds": leds}, capture=captures[scan], calibration=file)
                    for scan in (second, first)
                )
                if "error" in result and not stand:
                    stand = seats(captures, leds, scale, other, marks[first], first, second)
                tops = numbered_as(second, *_caps(before, marks[first], scale)[::2])
                found = measure(result, marks[second], scale, stand, tops)
                figures = ("" if np.isnan(v) else f"{v:.2f}" for v in found)
                row(str(count), f"{title} ({chosen})", graph, *figures)


def rendered_rows(
    data: Path, counts: list[int], graphs: tuple[str, ...], folder: Path, scale: int
) -> None:
    """Images by `see_touch` against those taken, by ball of the scan held out."""
    row(
        "LEDs",
        "film beside the balls by",
        "residual, median",
        "nine of ten below",
        "at most 1.5 / %",
        "of all pixels",
        "without the scratched ball",
    )
    row(*["---"] * 7)
    captures = _captures(data, folder, scale)
    for count in counts:
        leds, file = LEDS[count], folder / f"rendered{count}.npz"
        _calibrated(captures, leds, scale, file, ball_pitch_mm=PITCH_MM)
        for graph in graphs:
            params = {"capture": captures["balls_2"], "calibration": file}
            height = run(graph, {"frames.leds": leds}, **params)["height"]
            found = rendered(height, captures, leds, file, data / "balls_2.csv", scale)
            figures = [np.median(found), np.percentile(found, 90), 100 * np.mean(found <= 1.5)]
            whole = (_marked(data / "balls_2.csv", scale)[0] != SCRATCHED).any(axis=1)
            figures += [np.sqrt(np.mean(found[balls] ** 2)) for balls in (..., whole)]
            row(str(count), graph, *(f"{figure:.2f}" for figure in figures))


def _captures(data: Path, folder: Path, scale: int) -> dict[str, Path]:
    if not data.is_dir():
        raise SystemExit(f"there are no captures in {data}")
    return {name: reduced(data / name, folder, scale) for name in ("flat", "balls_1", "balls_2")}


def _calibrated(
    captures: Mapping[str, Path],
    leds: list[int],
    scale: int,
    file: Path,
    scan: str = SCANS[0],
    **how: Any,
) -> dict[str, Any]:
    """The quality of a calibration with a scan."""
    result = run(
        "calibrate",
        {"taken.leds": leds, "rest_taken.leds": leds},
        capture=captures[scan],
        flat=captures["flat"],
        ball_radius_mm=RADIUS_MM,
        pixel_size_mm=PIXEL_MM * scale,
        out=file,
        **how,
    )
    quality: dict[str, Any] = result["quality"]
    return quality


def reduced(capture: Path, folder: Path, scale: int) -> Path:
    """A capture of fewer pixels, each the mean of `scale` x `scale`, 16 bit."""
    if scale == 1:
        return capture
    small = folder / capture.name
    small.mkdir()
    for image in sorted(capture.glob("led*.png")):
        fine = cv2.imread(str(image), cv2.IMREAD_UNCHANGED).astype(np.float32)
        size = fine.shape[1] // scale, fine.shape[0] // scale
        mean = cv2.resize(fine, size, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(small / image.name), np.round(mean * 257).astype(np.uint16))
    return small


def measure(
    result: Mapping[str, Any],
    marks: Path,
    scale: int,
    stand: Seats | None = None,
    before: Mapping[tuple[float, ...], Cap] | None = None,
) -> Grid:
    """Compare a height map with the balls of a grid; their centres follow from the normals.

    `before` are the same balls by another scan.
    """
    height = result["height"]
    numbers, centres, found = _caps(result, marks, scale)
    tops = np.array([cap.top for cap in found])
    plane, whole = _common_plane(centres, tops)
    known = before or {}
    pairs = [
        (top, known[tuple(n)].top)
        for n, top in zip(numbers[whole], tops[whole], strict=True)
        if tuple(n) in known
    ]
    here, there = np.mean(pairs, axis=0) if pairs else (np.nan, np.nan)
    apart, stated, alike = _seated(numbers, centres, found, stand or {})
    between = _between(height.shape, numbers, centres, RADIUS_MM / (PIXEL_MM * scale))
    return Grid(
        normal_deg=float(np.mean([cap.deg for cap in found])),
        cap_um=1e3 * float(np.mean([cap.apart.std() for cap in found])),
        film_um=1e3 * float(height[between].std()),
        top_um=1e3 * float((tops - plane)[whole].std()),
        tops_percent=100 * float(here / there - 1),
        band_percent=float(np.mean([_band(c.apart - c.apart.mean(), c.stated) for c in found])),
        seated_percent=_band(apart, stated),
        stated_ratio=float(np.sqrt(np.square(stated).mean() / np.square(apart).mean())),
        stated_um=1e3 * float(np.median(np.concatenate([cap.stated for cap in found]))),
        alike=alike,
    )


def _caps(
    result: Mapping[str, Any], marks: Path, scale: int
) -> tuple[NDArray[Any], NDArray[Any], list[Cap]]:
    """Numbers, centres and caps of the marked balls."""
    height = result["height"]
    error = result["error"] if "error" in result else np.full_like(height, np.nan)
    numbers, centres = _marked(marks, scale)
    balls = _balls(height, centres, scale)
    return numbers, centres, [_judge_ball(height[at], error[at], ball) for at, ball in balls]


def _seated(
    numbers: NDArray[Any], centres: NDArray[Any], found: list[Cap], stand: Seats
) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Departures of all pixels from balls as the other scan has them; their stated deviation.

    Last the correlation of what the balls depart from a plane.
    """
    both = [n for n, number in enumerate(numbers) if tuple(number) in stand]
    if not both:
        return np.full(1, np.nan), np.full(1, np.nan), np.nan
    there, known = np.transpose([stand[tuple(numbers[n])] for n in both])
    here = np.array([found[n].apart.mean() for n in both])
    level, alike = _common_plane(centres[both], here - there)
    seated = [
        (found[both[k]].apart - there[k] - level[k], np.hypot(found[both[k]].stated, known[k]))
        for k in np.flatnonzero(alike)
    ]
    apart, stated = (np.concatenate(each) for each in zip(*seated, strict=True))
    planes = [_common_plane(centres[both], each) for each in (here, there)]
    on_both = planes[0][1] & planes[1][1]
    out = [(each - plane)[on_both] for each, (plane, _) in zip((here, there), planes, strict=True)]
    return apart, stated, float(np.corrcoef(out)[0, 1])


class Cap(NamedTuple):
    """What the inner part of a ball shows."""

    deg: float
    """Mean angle between normals, in degrees."""
    top: float
    """mm."""
    apart: NDArray[Any]
    """Height of its pixels above a sphere around the film at rest, in mm, and ..."""
    stated: NDArray[Any]
    """... its stated standard deviation."""


def _band(apart: NDArray[Any], stated: NDArray[Any]) -> float:
    """Per cent of the pixels in the 90 % band; NaN where nothing is stated, not a share of none."""
    if np.isnan(stated).any():
        return float("nan")
    return 100 * float((np.abs(apart) <= WITHIN_90 * stated).mean())


def _common_plane(
    centres: NDArray[Any], heights: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """The plane that most balls lie in, at every ball, and which do: others are worn, or loose."""
    terms = np.column_stack([centres, np.ones(len(centres))])
    used = np.ones(len(heights), bool)
    for _ in range(5):
        plane = terms @ np.linalg.lstsq(terms[used], heights[used], rcond=None)[0]
        away = np.abs(heights - plane)
        used = away <= ASTRAY_BALL * np.median(away)
    return np.asarray(plane), used


Seats = Mapping[tuple[float, ...], tuple[float, float]]
"""By a ball's number in the second scan: its height over a sphere on the film at rest, as the first
scan has it, and the stated standard deviation of that, in mm."""


def seats(
    captures: Mapping[str, Path],
    leds: list[int],
    scale: int,
    file: Path,
    marks: Path,
    first: str,
    second: str,
) -> Seats:
    """How the balls stand by the first scan, read by `precise` with a calibration by the second."""
    _calibrated(captures, leds, scale, file, second, ball_pitch_mm=PITCH_MM)
    result = run("precise", {"frames.leds": leds}, capture=captures[first], calibration=file)
    numbers, _, caps = _caps(result, marks, scale)
    stand = [(float(c.apart.mean()), float(np.sqrt(np.square(c.stated).mean()))) for c in caps]
    return numbered_as(second, numbers, stand)


def numbered_as(
    scan: str, numbers: NDArray[Any], values: list[Any]
) -> dict[tuple[float, ...], Any]:
    """What is known of the other scan's balls, by their numbers in a scan."""
    down, right = SAME_CHIP
    down = down if scan == SCANS[1] else -down
    return {(i - down, right - j): at for (i, j), at in zip(numbers, values, strict=True)}


class Ball(NamedTuple):
    """A ball in a window of the map: the window's normals, and places over the radius from it."""

    normals: NDArray[Any]
    u: NDArray[Any]
    v: NDArray[Any]

    @property
    def away(self) -> NDArray[Any]:
        return np.hypot(self.u, self.v)

    @property
    def shape(self) -> NDArray[Any]:
        """Its normals, and height over its centre in radii."""
        u, v = self.u, self.v
        return np.stack([u, v, np.sqrt(np.maximum(1 - u * u - v * v, 1e-4))])


def _marked(marks: Path, scale: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The balls' numbers on the lattice, and their centres in px."""
    with marks.open() as file:
        table = [[float(v) for v in line.values()] for line in csv.DictReader(file)]
    return np.array(table)[:, :2], (np.array(table)[:, 2:] + 0.5) / scale - 0.5


def _balls(
    height: NDArray[Any], centres: NDArray[Any], scale: int
) -> Iterator[tuple[tuple[slice, ...], Ball]]:
    """Every ball, with its window of the map.

    Marks err by about a pixel, so the centre is where the normals meet.
    """
    pixel = PIXEL_MM * scale
    smooth = gaussian_filter(height.astype(np.float64), SMOOTH_PX / scale)
    radius = RADIUS_MM / pixel
    for mark in centres:
        corner = np.maximum(mark.astype(int) - int(1.3 * radius), 0)
        window = tuple(slice(a, a + int(2.6 * radius)) for a in corner[::-1])
        q, p = np.gradient(smooth[window], pixel)
        n = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
        yy, xx = np.mgrid[: p.shape[0], : p.shape[1]]
        centre = x, y = mark - corner
        for _ in range(3):
            inside = np.hypot(xx - x, yy - y) < INNER * radius
            x, y = (np.median((a - c * radius)[inside]) for a, c in ((xx, n[0]), (yy, n[1])))
        if np.hypot(x - centre[0], y - centre[1]) * pixel > ASTRAY_PX * PIXEL_MM:
            x, y = centre
        yield window, Ball(n, (xx - x) / radius, (yy - y) / radius)


def _judge_ball(height: NDArray[Any], error: NDArray[Any], ball: Ball) -> Cap:
    """Compare a ball's cap with a sphere."""
    inside, truth = ball.away < INNER, ball.shape
    angle = np.degrees(np.arccos(np.clip((ball.normals * truth).sum(0), -1, 1)))[inside].mean()
    apart = (height - truth[2] * RADIUS_MM)[inside]
    return Cap(float(angle), float(height[inside].max()), apart, error[inside])


def rendered(
    height: NDArray[Any],
    captures: Mapping[str, Path],
    leds: list[int],
    file: Path,
    marks: Path,
    scale: int,
) -> NDArray[Any]:
    """By ball: residual of the images that `see_touch` makes of its true shape, on its inner part.

    It is relative to the film's noise and texture at rest, which scale with the light.  Around a
    ball the film is as `height` has it; an LED's gain between flat frame and scan is taken out.
    """
    numbers, centres = _marked(marks, scale)
    film = height.astype(np.float32)
    balls = list(_balls(height, centres, scale))
    for window, ball in balls:
        inside, top = ball.away < INNER, RADIUS_MM * ball.shape[2]
        film[window][inside] = (top + (height[window] - top)[inside].mean())[inside]
    see = load("see_touch", calibration=file, seed=None, bits=16, outputs=["image"])
    simulated = see(height=film)["image"]
    flat, captured = (
        np.stack([_fractions(captures[name] / f"led{k}.png") for k in leds])
        for name in ("flat", "balls_2")
    )
    between = _between(film.shape, numbers, centres, RADIUS_MM / (PIXEL_MM * scale))
    gain = np.median((captured / simulated)[:, between], axis=1)[:, None, None]
    smooth = gaussian_filter(flat, (0, TEXTURE_PX, TEXTURE_PX))
    texture = (flat / smooth - 1).std(axis=(1, 2))[:, None]
    ratios = []
    for window, ball in balls:
        inside = ball.away < INNER_SHARE
        off = (captured / gain - simulated)[(slice(None), *window)][:, inside]
        at_rest = texture * captured[(slice(None), *window)][:, inside]
        ratios.append(np.sqrt(np.mean(off**2) / np.mean(at_rest**2)))
    return np.array(ratios)


def _fractions(image: Path) -> NDArray[Any]:
    read = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    return read.astype(np.float32) / np.iinfo(read.dtype).max


def _between(
    size: tuple[int, ...], numbers: NDArray[Any], centres: NDArray[Any], reach: float
) -> NDArray[np.bool_]:
    """The film beside every ball of the lattice, those without a mark too."""
    known = np.column_stack([numbers, np.ones(len(numbers))])
    lattice, *_ = np.linalg.lstsq(known, centres, rcond=None)
    y, x = np.mgrid[: size[0], : size[1]]
    inverse = np.linalg.inv(lattice[:2])
    at = (np.stack([x, y], axis=-1) - lattice[2]) @ inverse
    away = (at - np.round(at)) @ lattice[:2]
    return np.asarray(np.hypot(away[..., 0], away[..., 1]) > BESIDE_REACH * reach)


def rigs(
    data: Path, names: list[str], shapes: list[str], graphs: tuple[str, ...], folder: Path
) -> None:
    """Root mean square errors in um; share within the 90 % band; stated over actual."""
    row("rig", "graph", *shapes)
    row(*["---"] * (2 + len(shapes)))
    for name in names:
        rig, calibration = data / name, calibrate_rig(data / name, folder)
        for graph in graphs:
            found = [
                run(graph, capture=rig / shape, calibration=calibration)["metrics"]
                for shape in shapes
            ]
            row(name, graph, *(_error(metrics) for metrics in found))


Image = NDArray[Any]


def seen_by(camera: Callable[[Image], Image], data: Path, names: list[str], folder: Path) -> Path:
    """The same captures by another camera."""
    for name in names:
        shutil.copytree(data / name, folder / name)
        for file in [*(folder / name).rglob("led*.png"), folder / name / "grid.png"]:
            image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
            cv2.imwrite(str(file), np.round(camera(image.astype(np.float32))).astype(image.dtype))
    return folder


def through_a_mosaic(image: Image) -> Image:
    """What a camera that interpolates colours makes of an image: neighbours share noise."""
    taps = np.array([0.5, 1, 0.5], np.float32)
    mosaic = np.zeros_like(image)
    mosaic[::2, ::2] = image[::2, ::2]
    return cv2.sepFilter2D(mosaic, -1, taps, taps, borderType=cv2.BORDER_REFLECT_101)


def blurred(image: Image, width_px: float) -> Image:
    """An image that a lens spreads, with as much noise as before; each image has its own."""
    noise = np.median(np.abs(image - cv2.GaussianBlur(image, (0, 0), 1.5))) / 0.6745
    lost = np.sqrt(max(1 - 1 / (4 * np.pi * width_px**2), 0))
    own = np.random.default_rng(zlib.crc32(image.tobytes()))
    again = own.normal(0, noise * lost, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), width_px) + again, 0, 255)


def calibrate_rig(rig: Path, folder: Path) -> Path:
    """Calibrate with both presses, the lens from the grid, the pupil where there is one."""
    scene = json.loads((rig / "calibration/scene.json").read_text())
    camera, file = folder / f"{rig.name}_camera.npz", folder / f"{rig.name}.npz"
    run("calibrate_camera", image=rig / "grid.png", pitch_mm=1.5, out=camera)
    presses = folder / f"{rig.name}_presses"
    presses.mkdir()
    for press in ("calibration", "calibration_off"):
        (presses / press).symlink_to(rig / press)
    more = {"camera_mm": scene["camera_mm"]} if scene["camera_mm"] else {}
    run(
        "calibrate",
        capture=presses,
        flat=rig / "flat",
        ball_radius_mm=scene["sphere_radius_mm"],
        lens=camera,
        out=file,
        **more,
    )
    return file


def _error(metrics: dict[str, float]) -> str:
    band = metrics.get("in_90_percent_band")
    microns = f"{1e3 * RIG_PIXEL_MM * metrics['rmse_px']:.1f}"
    if band is None:
        return microns
    return f"{microns}, {band:.0f} %, {metrics['stated_over_actual']:.1f}"


if __name__ == "__main__":
    main()
