"""Sensors: simulated, ray-traced and real, with their right touches and what calibrates them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, load
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.live.expose import expose
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_cat import shape_cat
from tactograph.nodes.simulate.shape_grating import shape_grating
from tactograph.nodes.simulate.shape_pyramid import shape_pyramid
from tactograph.nodes.simulate.shape_teapot import shape_teapot
from tactograph.nodes.simulate.shape_text import shape_text

F4 = NDArray[np.float32]
ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"
MINI_PRESSES = tuple(range(0, 44, 3))


class Recipe(NamedTuple):
    """What a sensor is calibrated with; `seen` is what its camera makes of a touch."""

    balls: F4
    flat: F4
    radius_mm: float
    pixel_mm: float
    more: dict[str, Any]
    seen: Callable[[F4], F4] | None = None


class Touch(NamedTuple):
    """A touch: its light (of recorded ones, the images), true height, and the camera's settings."""

    name: str
    light: F4
    height: F4 | None
    seed: int = 1
    full_well: float = 15000.0


@dataclass
class Rig:
    """A sensor."""

    name: str
    recipe: Recipe
    touches: list[Touch]
    azimuth_deg: NDArray[Any]
    rest: F4
    colour: bool = False
    sibling: str = ""
    simulate: Simulator | None = None
    right: list[Touch] = field(default_factory=list)

    @cached_property
    def canvas(self) -> dict[str, Any]:
        """The image, as shape nodes take it."""
        rows, columns = self.rest.shape[1:]
        return {"width_px": columns, "height_px": rows, "pixel_size_mm": self.recipe.pixel_mm}

    def grid(self) -> list[F4]:
        """x and y of the pixels in mm from the middle."""
        return grid(self.rest.shape[1:], self.recipe.pixel_mm)

    def photograph(self, light: F4, touch: Touch) -> F4:
        """The camera's 8-bit images; those of a recorded touch are there already."""
        if self.simulate is None:
            return np.asarray(np.rint(light.clip(0, 1) * 255) / 255, np.float32)
        light = np.maximum(light, 0)
        return expose(light, seed=touch.seed, full_well=touch.full_well).image

    def balls(self) -> list[F4]:
        return [] if self.simulate is None else [object for _, object in self.simulate.presses()]

    def recipe_of(self, objects: list[F4]) -> Recipe | None:
        """The same with other objects pressed; None for a recorded sensor."""
        if self.simulate is None:
            return None
        return self.recipe._replace(balls=self.simulate.photographs(objects))


def grid(size: tuple[int, ...], pixel_mm: float) -> list[F4]:
    y, x = (np.float32(np.arange(n) - (n - 1) / 2) * np.float32(pixel_mm) for n in size)
    return list(np.meshgrid(x, y))


@dataclass
class Simulator:
    """Renders touches by a shipped graph, loaded once, and keeps them on disk."""

    graph: str
    settings: dict[str, Any]
    lights: F4
    size: tuple[int, int]
    pixel_mm: float
    folder: Path
    radius_mm: float = 5.0

    @cached_property
    def canvas(self) -> dict[str, Any]:
        rows, columns = self.size
        return {"width_px": columns, "height_px": rows, "pixel_size_mm": self.pixel_mm}

    @cached_property
    def _pipeline(self) -> Any:
        file = self.folder / "object.npy"
        np.save(file, np.zeros(self.size, np.float32))
        hand = self.graph == "simulate_hand"
        outputs = {"light": "lens", "height": "seen.height"} if hand else {
            "light": "scene.light", "height": "film"}  # fmt: skip
        shape = {"file": str(file), "pixel_size_mm": "$pixel_size_mm"}
        patch = [{"replace": "shape", "op": "shape_image", "with": shape}]
        graph = {"format": 1, "extends": self.graph, "patch": patch, "outputs": outputs}
        return load(graph, out=self.folder / "unused", **self.canvas, **self.settings)

    @cached_property
    def film(self) -> F4:
        """What the film at rest and the lens are like: fine grain, vignetting off the middle."""
        rng = np.random.default_rng(5)
        grain = cv2.GaussianBlur(rng.normal(size=self.size), (0, 0), 1.2)
        x, y = grid(self.size, 2 / self.size[1])
        shade = 1 - 0.2 * ((x - 0.15) ** 2 + (y + 0.1) ** 2)
        return np.asarray(shade * (1 + 0.01 * grain / grain.std()), np.float32)

    def __call__(self, object: F4, rigid: bool = False, lights: F4 | None = None) -> Any:
        """The light and the film's height under an object that is pressed in."""
        lights = self.lights if lights is None else lights
        key = repr((self.graph, self.settings, self.pixel_mm, rigid, lights.tolist())).encode()
        file = self.folder / f"{hashlib.sha256(key + object.tobytes()).hexdigest()[:24]}.npz"
        if not file.exists():
            np.save(self.folder / "object.npy", object)
            given = self.folder / f"{file.stem}.npy"
            np.save(given, object)
            self._pipeline.set("shape", file=str(given))
            self._pipeline.set("film", reach_mm=0.0 if rigid else 0.5, skin_mm=0 if rigid else 0.1)
            self._pipeline.set("lights", positions_mm=[tuple(map(float, p)) for p in lights])
            made = self._pipeline()
            given.unlink()
            np.savez_compressed(file, light=made["light"], height=made["height"])
        with np.load(file) as found:
            return found["light"] * self.film, found["height"]

    def presses(self) -> Iterator[tuple[tuple[float, float], F4]]:
        """The calibration's balls: one in the middle, and beside it where the light is uneven."""
        places = [(0.0, 0.0)] if self.graph == "simulate_press" else [(0, 0), (-2.5, 1), (2.5, -1)]
        for place in places:
            ball = shape_ball(radius_mm=5.0, rise_mm=2.0, offset_mm=place, **self.canvas)
            yield place, ball.height

    def photographs(self, objects: list[F4]) -> F4:
        lights = [self(object)[0] for object in objects]
        return np.stack([expose(light, seed=90 + i).image for i, light in enumerate(lights)])


RINGS: dict[str, tuple[str, int, float, float, float]] = {
    "far": ("simulate_press", 4, 28.0, 380.0, 45.0),
    "near": ("simulate_press", 4, 33.0, 55.0, 50.0),
    "six": ("simulate_press", 6, 36.0, 60.0, 20.0),
    "hand": ("simulate_hand", 4, 39.0, 47.0, 45.0),
}
"""Graph, number of LEDs, their slant, distance and first azimuth."""
SIBLINGS = {"far": "near", "near": "far", "hand": "near", "far28": "near33", "near33": "far28"}


def simulated(name: str, cache: Path, right: int, scale: int = 1) -> Rig:
    """A simulated sensor, its base touches, and `right` right ones."""
    graph, count, slant, distance, first = RINGS[name]
    lights = light_ring(
        count=count, slant_deg=slant, first_azimuth_deg=first, distance_mm=distance
    )
    hand = {"camera_mm": 65.0, "lens_at_corner": 0.0} if name == "hand" else {}
    folder = cache / f"{name}{scale}"
    folder.mkdir(parents=True, exist_ok=True)
    size = 120 * scale, 160 * scale
    make = Simulator(graph, hand, lights, size, 0.1 / scale, folder)
    flat = expose(make(np.zeros(size, np.float32))[0], seed=80).image
    more = {"camera_mm": 65.0} if hand else {}
    balls = make.photographs([ball for _, ball in make.presses()])
    objects = {
        "ball": shape_ball(radius_mm=4.0, rise_mm=1.5, offset_mm=(0.7, -0.4), **make.canvas),
        "cat": shape_cat(length_mm=9.0, rise_mm=1.2, **make.canvas),
        "soft": shape_ball(radius_mm=5.0, rise_mm=0.5, offset_mm=(-2.5, 1.2), **make.canvas),
    }
    touches = [Touch(n, *make(o.height), seed=7 + i) for i, (n, o) in enumerate(objects.items())]
    azimuth = np.degrees(np.arctan2(lights[:, 1], lights[:, 0]))
    rest = make(np.zeros(size, np.float32))[0]
    rig = Rig(name, Recipe(balls, flat, 5.0, make.pixel_mm, more), touches, azimuth, rest)
    rig = replace(rig, sibling=SIBLINGS.get(name, ""), simulate=make)
    rig.right = [right_touch(make, i) for i in range(right)]
    return rig


def right_touch(make: Simulator, number: int) -> Touch:
    """A touch as it may be: shape, depth, place, noise, dust and drift by the number's chance."""
    rng = np.random.default_rng(1000 + number)
    name, object = right_object(number, rng, make.canvas)
    light, height = make(object)
    full_well = float(rng.choice([4000, 15000, 60000]))
    x, y = grid(make.size, 2 / make.size[1])
    if number % 3 == 1:  # LEDs have drifted by some per cent, unevenly.
        for k in range(len(light)):
            level, east, south = rng.normal(0, (0.03, 0.01, 0.01))
            light[k] *= np.asarray(1 + level + east * x + south * y, np.float32)
        name += ", drifted"
    if number % 4 == 3:
        for column, row in rng.integers((0, 0), make.size[::-1], (4, 2)):
            light[:, row : row + 2, column : column + 2] *= np.float32(rng.uniform(0.6, 0.9))
        name += ", dust"
    return Touch(f"{name}, {full_well:g} electrons", light, height, 200 + number, full_well)


def right_object(number: int, rng: Any, canvas: dict[str, Any]) -> tuple[str, F4]:
    depth = float(rng.choice([0.05, 0.2, 0.6, 1.2, 1.8]))
    place = tuple(rng.uniform((-3, -2), (3, 2)))
    aside = (float(rng.choice([-7, 7])), float(rng.uniform(-4, 4)))
    angle = float(rng.uniform(0, 360))
    ball = partial(shape_ball, **canvas)
    shapes: dict[str, Callable[[], Any]] = {
        "ball": lambda: ball(radius_mm=4.0, rise_mm=depth, offset_mm=place).height,
        "cat": lambda: shape_cat(
            length_mm=8.0, rise_mm=depth, angle_deg=angle, offset_mm=place, **canvas
        ).height,
        "text": lambda: shape_text(
            text="OK", size_mm=5.0, rise_mm=min(depth, 0.6), angle_deg=angle, **canvas
        ).height,
        "cut ball": lambda: ball(radius_mm=3.0, rise_mm=min(depth, 1.2), offset_mm=aside).height,
        "teapot": lambda: shape_teapot(
            length_mm=9.0, rise_mm=depth, angle_deg=angle, offset_mm=place, **canvas
        ).height,
        "grating": lambda: shape_grating(
            period_mm=1.6, rise_mm=min(depth, 0.4), profile="sine", side_mm=7.0,
            angle_deg=angle, **canvas,
        ).height,
        "pyramid": lambda: shape_pyramid(
            inradius_mm=3.0, rise_mm=min(depth, 1.2), angle_deg=angle, offset_mm=place, **canvas
        ).height,
        "three balls": lambda: np.max(
            [ball(radius_mm=2.0, rise_mm=min(depth, 1.0), offset_mm=(x, y)).height
             for x, y in ((-4, -2), (3.5, -1), (0, 3))], axis=0),
        "small ball": lambda: ball(radius_mm=1.0, rise_mm=min(depth, 0.4), offset_mm=place).height,
        "nothing": lambda: np.zeros((canvas["height_px"], canvas["width_px"]), np.float32),
    }  # fmt: skip
    name = list(shapes)[number % len(shapes)]
    return f"{name} {depth:g} mm", np.asarray(shapes[name](), np.float32)


def images(folder: Path, scale: int = 1) -> F4:
    """The images of a capture, K x H x W, each pixel the mean of `scale` x `scale`."""
    found = []
    for file in sorted(folder.glob("led*.png")):
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED).astype(np.float32) / 255
        size = image.shape[1] // scale, image.shape[0] // scale
        found.append(cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale > 1 else image)
    return np.stack(found)


def raytraced(name: str, cache: Path) -> Rig | None:
    """A rig of the ray tracer."""
    folders = (ROOT / "tests/data" / name, SHARED / "raytraced" / name)
    folder = next((f for f in folders if f.is_dir()), None)
    if folder is None:
        return None
    facts = json.loads((folder / "flat/scene.json").read_text())
    hand = name.startswith("hand")
    balls = ("calibration", "calibration_off") if hand else ("calibration",)
    base = ("sphere_film", "cat_film")
    others = ("corner_film", "teapot_film") if hand else ("sphere", "cat")
    touch = lambda n: Touch(n, images(folder / n), np.load(folder / n / "truth_height_mm.npy"))  # noqa: E731
    flat = images(folder / "flat")
    more = {"camera_mm": facts["camera_mm"]} if facts.get("camera_mm") else {}
    presses = np.stack([images(folder / n) for n in balls])
    recipe = Recipe(presses, flat, 6.0 if hand else 7.0, facts["pixel_size_mm"], more)
    lights = np.array(facts["lights_mm"])
    azimuth = np.degrees(np.arctan2(lights[:, 1], lights[:, 0]))
    rig = Rig(name, recipe, [touch(n) for n in base], azimuth, flat)
    return replace(
        rig, sibling=SIBLINGS.get(name, ""), right=[touch(n) for n in (*base, *others, "flat")]
    )


def mini(cache: Path) -> Rig | None:
    """The real GelSight Mini: a third of its presses calibrate, the others are touches."""
    folder = SHARED / "real/gelsight_mini_balls"
    if not folder.is_dir():
        return None

    def seen(file: Path) -> F4:
        image = cv2.imread(str(file), cv2.IMREAD_COLOR).astype(np.float32) / 255
        return np.ascontiguousarray(image.transpose(2, 0, 1))

    presses = {n: seen(folder / f"6.310mm/{n}/gelsight.png") for n in range(44)}
    flat = seen(folder / "background.png")
    balls = np.stack([presses[n] for n in MINI_PRESSES])
    others = [Touch(f"press {n}", p, None) for n, p in presses.items() if n not in MINI_PRESSES]
    recipe = Recipe(balls, flat, 6.31 / 2, 0.0634, {})
    rig = Rig("mini", recipe, [others[3], others[12]], np.zeros(3), flat, colour=True)
    return replace(rig, right=[*others, Touch("untouched", flat, None)])


def six_real(cache: Path) -> Rig | None:
    """The real sensor with six LEDs and a grid of balls, at a quarter of its resolution."""
    folder, scale = SHARED / "real/gelsight_six_led", 4
    if not folder.is_dir():
        return None
    flat, one, two = (images(folder / n, scale) for n in ("flat", "balls_1", "balls_2"))
    more = {"ball_pitch_mm": 1.0}
    recipe = Recipe(one[None], flat, 0.2475, 0.003404 * scale, more)
    azimuth = np.array([-88, -152, 147, 89, 33, -26])
    touches = [Touch("balls_2", two, None), Touch("balls_1", one, None)]
    rig = Rig("six_real", recipe, touches[:1], azimuth, flat)
    return replace(rig, right=[*touches, Touch("untouched", flat, None)])


def makers(right: int) -> dict[str, Callable[[Path], Rig | None]]:
    """All sensors by name; each is made, or read, when it is called."""
    made: dict[str, Callable[[Path], Rig | None]] = {
        name: partial(simulated, name, right=right) for name in RINGS
    }
    made |= {name: partial(raytraced, name) for name in ("far28", "near33", "hand_rt")}
    made["hand_rt"] = partial(raytraced, "hand")
    return made | {"mini": mini, "six_real": six_real}


def calibrated(recipe: Recipe, colour: bool, cache: Path) -> tuple[Path, dict[str, Any]]:
    """The calibration of a recipe, and what was said and measured while it was made.

    Raises
    ------
    InputError
        If the recipe is refused.
    """
    parts = recipe.balls.tobytes() + recipe.flat.tobytes() + repr(recipe[2:5]).encode()
    folder = cache / "calibrations" / hashlib.sha256(parts).hexdigest()[:24]
    file, said = folder / "cal.npz", folder / "said.json"
    if not said.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write(folder / "flat", recipe.flat, colour)
        for i, ball in enumerate(recipe.balls):
            write(folder / "balls" / f"{i:02}", ball, colour)
        said.write_text(json.dumps(calibrate(recipe, colour, folder, file)))
    found = json.loads(said.read_text())
    if found.get("refused"):
        raise InputError(found["refused"])
    return file, found


def calibrate(recipe: Recipe, colour: bool, folder: Path, file: Path) -> dict[str, Any]:
    graph = read_graph("calibrate_presses" if colour else "calibrate")
    kept = {name: entry for name, entry in graph.nodes.items() if not entry.op.startswith("plot_")}
    single = folder / "balls" / "00"
    capture = {"captures": folder / "balls"} if colour else {
        "capture": folder / "balls" if len(recipe.balls) > 1 else single}  # fmt: skip
    given = {
        **{name: str(path) for name, path in capture.items()},
        "flat": str(folder / "flat"),
        "ball_radius_mm": recipe.radius_mm,
        "pixel_size_mm": recipe.pixel_mm,
        "out": str(file),
        **recipe.more,
    }
    try:
        (result,) = open_pipeline(replace(graph, nodes=kept), given).items()
    except InputError as error:
        return {"refused": str(error)}
    figures = {k: v for k, v in result["quality"].items() if isinstance(v, int | float)}
    return {"warnings": result.warnings, "figures": figures}


def write(folder: Path, image: F4, colour: bool) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    counts = np.asarray(np.rint(image.clip(0, 1) * 65535), np.uint16)
    if colour:
        cv2.imwrite(str(folder / "touch.png"), counts.transpose(1, 2, 0))
        return
    for k, plane in enumerate(counts, start=1):
        cv2.imwrite(str(folder / f"led{k}.png"), plane)


@cache
def pipeline(graph: str, file: Path) -> Any:
    """A graph that is ready to run with a calibration, loaded once."""
    return load(graph, calibration=str(file))
