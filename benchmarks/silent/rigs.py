"""Sensors: simulated, ray-traced and real, with their valid touches and what calibrates them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from silent.calibrations import F4, Recipe, key_of
from tactograph.graph import load
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_flat import shape_flat
from tactograph.rings.shapes.nodes.shape_cat import shape_cat
from tactograph.rings.shapes.nodes.shape_grating import shape_grating
from tactograph.rings.shapes.nodes.shape_pyramid import shape_pyramid
from tactograph.rings.shapes.nodes.shape_teapot import shape_teapot
from tactograph.rings.shapes.nodes.shape_text import shape_text

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"


class Touch(NamedTuple):
    """A touch: its light (of recorded ones, the images), true height, and the camera's settings."""

    name: str
    light: F4
    height: F4 | None
    seed: int = 1
    full_well: float = 15000.0


@dataclass
class Rig:
    """A sensor: what calibrates it, touches to be spoilt, the untouched film, valid touches."""

    name: str
    recipe: Recipe
    touches: list[Touch]
    azimuth_deg: NDArray[Any]
    rest: F4
    valid: list[Touch]
    colour: bool = False
    simulate: Simulator | None = None
    slow: bool = False
    """Whether it takes a minute to calibrate."""

    @cached_property
    def canvas(self) -> dict[str, Any]:
        return canvas(self.rest.shape[1:], self.recipe.pixel_mm)

    def grid(self) -> list[F4]:
        """x and y of the pixels in mm from the middle."""
        return grid(self.rest.shape[1:], self.recipe.pixel_mm)

    def photograph(self, light: F4, touch: Touch) -> F4:
        """The camera's images of a light; a recorded one is such images."""
        if self.simulate is None:
            return np.clip(light, 0, 1)
        return expose(np.maximum(light, 0), seed=touch.seed, full_well=touch.full_well).image

    def balls(self) -> list[F4]:
        """The balls that calibrate a simulated sensor."""
        return [] if self.simulate is None else self.simulate.balls()

    def recipe_of(self, objects: list[F4]) -> Recipe | None:
        """The recipe with other objects pressed; None for a recorded sensor."""
        if self.simulate is None:
            return None
        return self.recipe._replace(balls=self.simulate.photographs(objects))


def canvas(size: tuple[int, ...], pixel_mm: float) -> dict[str, Any]:
    """The image, as shape nodes take it."""
    return {"width_px": size[1], "height_px": size[0], "pixel_size_mm": pixel_mm}


def grid(size: tuple[int, ...], pixel_mm: float) -> list[F4]:
    y, x = (np.float32(np.arange(n) - (n - 1) / 2) * np.float32(pixel_mm) for n in size)
    return list(np.meshgrid(x, y))


class Ring(NamedTuple):
    """A simulated sensor: a shipped graph, its LEDs, and the balls' places in mm."""

    graph: str
    leds: int
    slant_deg: float
    distance_mm: float
    azimuth_deg: float
    places: list[tuple[float, float]]
    pixel_mm: float = 0.1
    colour: bool = False


MIDDLE = [(0.0, 0.0)]
MANY = [(x, y) for y in (-3.0, 0.0, 3.0) for x in (-5.0, -1.7, 1.7, 5.0)]
RINGS = {
    "far": Ring("simulate_press", 4, 28.0, 380.0, 45.0, MIDDLE),
    "near": Ring("simulate_press", 4, 33.0, 55.0, 50.0, MIDDLE),
    "near_fine": Ring("simulate_press", 4, 33.0, 55.0, 50.0, MIDDLE, pixel_mm=0.05),
    "six": Ring("simulate_press", 6, 36.0, 60.0, 20.0, MIDDLE),
    "hand": Ring("simulate_hand", 4, 39.0, 47.0, 45.0, [*MIDDLE, (-2.5, 1.0)]),
    "colour": Ring("simulate_press", 3, 55.0, 40.0, 90.0, MANY, colour=True),
}
FRAME_MM, BALL_MM = (12.0, 16.0), 4.0


class Simulator:
    """Renders touches by a shipped graph, loaded once, and keeps them in a folder."""

    def __init__(self, ring: Ring, folder: Path) -> None:
        self.ring, self.folder = ring, folder
        self.size = int(FRAME_MM[0] / ring.pixel_mm), int(FRAME_MM[1] / ring.pixel_mm)
        self.canvas = canvas(self.size, ring.pixel_mm)
        self.hand = ring.graph == "simulate_hand"
        self.lights = light_ring(
            count=ring.leds,
            slant_deg=ring.slant_deg,
            first_azimuth_deg=ring.azimuth_deg,
            distance_mm=ring.distance_mm,
        )

    @cached_property
    def pipeline(self) -> Any:
        captured = {"light": "lens", "height": "view.height"}
        outputs = captured if self.hand else {"light": "scene.light", "height": "film"}
        shape = {"file": "none.npy", "pixel_size_mm": "$pixel_size_mm"}
        patch = [{"replace": "shape", "op": "shape_image", "with": shape}]
        graph = {"format": 1, "extends": self.ring.graph, "patch": patch, "outputs": outputs}
        view = {"lens_at_corner": 0.0, **self.canvas} if self.hand else {}
        params = {"out": self.folder / "unused", "pixel_size_mm": self.ring.pixel_mm}
        return load(graph, params | view)

    @cached_property
    def film(self) -> F4:
        """What film at rest and lens are like: fine grain, and vignetting off the middle."""
        rng = np.random.default_rng(5)
        grain = cv2.GaussianBlur(rng.normal(size=self.size), (0, 0), 1.2)
        x, y = grid(self.size, 2 / self.size[1])
        shade = 1 - 0.2 * ((x - 0.15) ** 2 + (y + 0.1) ** 2)
        return np.asarray(shade * (1 + 0.01 * grain / grain.std()), np.float32)

    def __call__(self, object: F4, rigid: bool = False, lights: F4 | None = None) -> Any:
        """The light, and the height of the film into which an object is pressed."""
        places = np.round(self.lights if lights is None else lights, 6).tolist()
        key = key_of(self.ring.graph, (self.ring, rigid, places), object)
        file = self.folder / f"{key}.npz"
        if not file.exists():
            with tempfile.NamedTemporaryFile(suffix=".npy") as stored:
                np.save(stored.name, object)
                self.pipeline.set("shape", file=stored.name)
                self.pipeline.set("film", reach_mm=0.5 * (not rigid), skin_mm=0.1 * (not rigid))
                self.pipeline.set("lights", positions_mm=places)
                result = self.pipeline()
            part = file.with_suffix(".part.npz")
            np.savez_compressed(part, light=result["light"], height=result["height"])
            part.rename(file)
        with np.load(file) as found:
            return found["light"] * self.film, found["height"]

    def balls(self) -> list[F4]:
        """The balls of the calibration, one a press."""
        ball = partial(shape_ball, radius_mm=BALL_MM, rise_mm=1.0 if self.ring.colour else 2.0)
        return [ball(offset_mm=place, **self.canvas).height for place in self.ring.places]

    def photographs(self, objects: list[F4]) -> F4:
        """The objects on a soft film, or bare where the film's own bounces blur its contact."""
        lights = [self(object, rigid=self.hand)[0] for object in objects]
        return np.stack([expose(light, seed=90 + i).image for i, light in enumerate(lights)])


def simulated(name: str, folder: Path, valid: int, first: int = 0) -> Rig:
    """A simulated sensor and `valid` valid touches, by their numbers from `first` on."""
    ring, folder = RINGS[name], folder / name
    folder.mkdir(parents=True, exist_ok=True)
    make = Simulator(ring, folder)
    rest = make(np.zeros(make.size, np.float32))[0]
    more = {"camera_mm": 65.0} if make.hand else {}
    flat, balls = expose(rest, seed=80).image, make.photographs(make.balls())
    objects = [
        ("ball", shape_ball(radius_mm=4.0, rise_mm=1.5, offset_mm=(0.7, -0.4), **make.canvas)),
        ("cat", shape_cat(length_mm=9.0, rise_mm=1.2, **make.canvas)),
        ("soft", shape_ball(radius_mm=5.0, rise_mm=0.5, offset_mm=(-2.5, 1.2), **make.canvas)),
    ]
    touches = [Touch(n, *make(o.height), seed=7 + i) for i, (n, o) in enumerate(objects)]
    azimuth = np.degrees(np.arctan2(make.lights[:, 1], make.lights[:, 0]))
    recipe = Recipe(balls, flat, BALL_MM, ring.pixel_mm, more)
    chosen = [valid_touch(make, first + i) for i in range(valid)]
    return Rig(name, recipe, touches, azimuth, rest, chosen, ring.colour, make, make.hand)


def valid_touch(make: Simulator, number: int) -> Touch:
    """A touch as it may be: shape, depth, place, noise, drift and dust by the number's chance."""
    rng = np.random.default_rng(1000 + number)
    name, object = right_object(number, rng, make.canvas)
    light, height = make(object)
    full_well = float(rng.choice([4000, 15000, 60000]))
    x, y = grid(make.size, 2 / make.size[1])
    if number % 3 == 1:  # LEDs have faded by some per cent, unevenly.
        for k in range(len(light)):
            level, east, south = rng.normal(0, (0.03, 0.01, 0.01))
            light[k] *= 1 + level + east * x + south * y
        name += ", drifted"
    if number % 4 == 3:
        for row, column in rng.integers(0, make.size, (4, 2)):
            light[:, row : row + 2, column : column + 2] *= rng.uniform(0.6, 0.9)
        name += ", dust"
    return Touch(f"{name}, {full_well:g} electrons", light, height, 200 + number, full_well)


def right_object(number: int, rng: Any, canvas: dict[str, Any]) -> tuple[str, F4]:
    depth, place = float(rng.choice([0.05, 0.2, 0.6, 1.2, 1.8])), tuple(rng.uniform(-3, 3, 2))
    cut = float(rng.choice([-7, 7])), float(rng.uniform(-4, 4))
    here, turn = {"offset_mm": place, **canvas}, {"angle_deg": float(rng.uniform(0, 360))}
    low = {"rise_mm": min(depth, 0.4), **canvas}
    thirds = [
        partial(shape_ball, radius_mm=2.0, rise_mm=min(depth, 1.0), offset_mm=at, **canvas)
        for at in ((-4, -2), (3.5, -1), (0, 3))
    ]
    shapes: dict[str, list[Callable[[], Any]]] = {
        "ball": [partial(shape_ball, radius_mm=4.0, rise_mm=depth, **here)],
        "cat": [partial(shape_cat, length_mm=8.0, rise_mm=depth, **turn, **here)],
        "text": [partial(shape_text, text="OK", **turn, **low)],
        "cut ball": [
            partial(shape_ball, radius_mm=3.0, rise_mm=min(depth, 1.2), offset_mm=cut, **canvas)
        ],
        "teapot": [partial(shape_teapot, length_mm=9.0, rise_mm=depth, **turn, **here)],
        "grating": [
            partial(shape_grating, period_mm=1.6, profile="sine", side_mm=7.0, **turn, **low)
        ],
        "pyramid": [partial(shape_pyramid, rise_mm=min(depth, 1.2), **turn, **here)],
        "three balls": thirds,
        "small ball": [partial(shape_ball, radius_mm=1.0, offset_mm=place, **low)],
        "nothing": [partial(shape_flat, **canvas)],
    }
    name = list(shapes)[number % len(shapes)]
    return f"{name} {depth:g} mm", np.max([make().height for make in shapes[name]], axis=0)


def images(folder: Path, scale: int = 1) -> F4:
    """The images of a capture, K x H x W, each pixel the mean of `scale` x `scale`."""
    found = []
    for file in sorted(folder.glob("led*.png")):
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED).astype(np.float32) / 255
        size = image.shape[1] // scale, image.shape[0] // scale
        found.append(cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale > 1 else image)
    return np.stack(found)


def raytraced(name: str, _: Path) -> Rig | None:
    """A rig of the ray tracer."""
    folders = (ROOT / "tests/data" / name, SHARED / "raytraced" / name)
    folder = next((f for f in folders if f.is_dir()), None)
    if folder is None:
        return None
    hand = name.startswith("hand")
    facts = json.loads((folder / "flat/scene.json").read_text())
    balls = ("calibration", "calibration_off") if hand else ("calibration",)
    hard = ("corner_film", "teapot_film") if hand else ("sphere", "cat")
    names = ("sphere_film", "cat_film", *hard, "flat")
    touches = [
        Touch(n, images(folder / n), np.load(folder / n / "truth_height_mm.npy")) for n in names
    ]
    presses, flat = np.stack([images(folder / n) for n in balls]), images(folder / "flat")
    more = {"camera_mm": facts["camera_mm"]} if facts.get("camera_mm") else {}
    recipe = Recipe(presses, flat, 6.0 if hand else 7.0, facts["pixel_size_mm"], more)
    x, y, _ = np.transpose(facts["lights_mm"])
    azimuth, label = np.degrees(np.arctan2(y, x)), f"raytraced_{name}"
    return Rig(label, recipe, touches[:2], azimuth, flat, touches[2:], slow=hand)


def mini(_: Path) -> Rig | None:
    """The real GelSight Mini: two thirds of its presses calibrate, the others are touches."""
    folder = SHARED / "real/gelsight_mini_balls"
    if not folder.is_dir():
        return None

    def image_of(file: Path) -> F4:
        return cv2.imread(str(file)).astype(np.float32).transpose(2, 0, 1) / np.float32(255)

    presses = [image_of(folder / f"6.310mm/{n}/gelsight.png") for n in range(44)]
    flat, balls = (
        image_of(folder / "background.png"),
        np.stack([p for n, p in enumerate(presses) if n % 3]),
    )
    others = [Touch(f"press {n}", p, None) for n, p in enumerate(presses) if n % 3 == 0]
    recipe = Recipe(balls, flat, 6.31 / 2, 0.0634, {})
    valid = [*others, Touch("untouched", flat, None)]
    base = [others[3], others[12]]
    return Rig("mini", recipe, base, np.zeros(3), flat, valid, colour=True, slow=True)


def six_real(_: Path) -> Rig | None:
    """The real sensor with six LEDs and a grid of balls, at a quarter of its resolution."""
    folder, scale = SHARED / "real/gelsight_six_led", 4
    if not folder.is_dir():
        return None
    flat, one, two = (images(folder / n, scale) for n in ("flat", "balls_1", "balls_2"))
    recipe = Recipe(one[None], flat, 0.2475, 0.003404 * scale, {"ball_pitch_mm": 1.0})
    azimuth = np.array([-88, -152, 147, 89, 33, -26])
    valid = [Touch("balls_1", one, None), Touch("untouched", flat, None)]
    base = [Touch("balls_2", two, None)]
    return Rig("six_real", recipe, base, azimuth, flat, valid, slow=True)


def makers(valid: int) -> dict[str, Callable[[Path], Rig | None]]:
    """All sensors by name, each made or read when it is called with a folder to keep files in."""
    return {
        **{name: partial(simulated, name, valid=valid) for name in RINGS},
        **{f"raytraced_{n}": partial(raytraced, n) for n in ("far28", "near33", "hand")},
        "mini": mini,
        "six_real": six_real,
    }
