"""A simulated sensor: film, LEDs, a ball that is pressed and rolled around, and faults."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Annotated, Any, NamedTuple, TypeVar
from urllib.parse import parse_qsl

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass
from scipy.interpolate import CubicSpline

from tactograph.rings.frames.colour_planes import MAX_BYTE
from tactograph.sdk import F4, Film, InputError, LightPositions, ShapeImage, image_places
from tactograph.sdk.nodes import expose, film_light, light_ring, press, render, shape_ball

PAPER_PIXEL_MM = ShapeImage().pixel_size_mm
EXPOSURE_S, EXPOSURE_SHARE = 0.02, 0.6
"""Default exposure, and the largest share of the frame time that it takes."""
DEPTH_COUNT = 9
"""Number of depths at which the film's shape is computed; it is interpolated between them."""
RADIUS_SAMPLES = 4096
"""Number of distances from the ball's axis at which the shape is tabulated."""
REACH_MM = 3.0
"""Distance from the contact at which the film is at rest: six times `press`'s own reach."""
NOISE_IMAGES = 8
"""Number of noise fields, used in turn."""
DRAG_REACH_MM = 4.0
"""Standard deviation of a drag's fall-off around the ball."""
MIN_AXIS_MM = np.float32(1e-6)
"""Smallest distance from the ball's axis; prevents division by 0."""
RECENT_FRAMES = 8
"""Number of latest films that are kept, for all LEDs and the true height."""


@checked_dataclass(frozen=True, config={"extra": "forbid"})
class Scene:
    """The sensor and the ball that presses it; defaults agree with the graph `simulate`.

    The ball's axis moves on a circle of radius `path_mm` once in `period_s`, and in `press_s` the
    ball goes down to `depth_mm` and up again.  Pressed `by_hand`, it stays away for `rest_s` and
    then comes down once in every `press_s`, each time elsewhere within `path_mm` of the middle,
    and is held still for about half of the time.

    With a `marker_pitch_mm`, dots of radius `marker_mm` are printed on the film.  The ball drags
    the film to the right, by `drag_mm` at full depth (`print_markers`).

    Without an `exposure_s`, the exposure is the shorter of `EXPOSURE_S` and `EXPOSURE_SHARE` of the
    frame time.
    """

    width_px: Annotated[int, Interval(ge=8, le=4096)] = 640
    height_px: Annotated[int, Interval(ge=8, le=4096)] = 480
    pixel_size_mm: Annotated[float, Gt(0)] = PAPER_PIXEL_MM / 2
    slant_deg: Annotated[float, Interval(ge=0, lt=90)] = 28.0
    distance_mm: Annotated[float, Gt(0)] = 380.0
    radius_mm: Annotated[float, Gt(0)] = 4.0
    depth_mm: Annotated[float, Ge(0)] = 1.0
    path_mm: Annotated[float, Ge(0)] = 3.0
    period_s: Annotated[float, Gt(0)] = 20.0
    press_s: Annotated[float, Gt(0)] = 8.0
    by_hand: bool = False
    rest_s: Annotated[float, Ge(0)] = 6.0
    marker_pitch_mm: Annotated[float, Ge(0)] = 0.0
    marker_mm: Annotated[float, Gt(0)] = 0.25
    drag_mm: Annotated[float, Interval(ge=0, le=5)] = 0.0
    exposure_s: Annotated[float, Gt(0)] | None = None
    readout_s: Annotated[float, Ge(0)] = 0.0
    ambient: Annotated[float, Ge(0)] = 0.0
    vignetting: Annotated[float, Interval(ge=0, le=1)] = 0.0
    full_well: Annotated[float, Gt(0)] = 15000.0
    read_noise: Annotated[float, Ge(0)] = 10.0
    seed: Annotated[int, Ge(0)] = 0

    @property
    def lights(self) -> LightPositions:
        """LED positions."""
        return light_ring(slant_deg=self.slant_deg, distance_mm=self.distance_mm)


SceneKind = TypeVar("SceneKind", bound=Scene)


def read_scene(
    text: str, kind: type[SceneKind], defaults: Mapping[str, Any] | None = None
) -> SceneKind:
    """Read ``simulated`` or ``simulated?radius_mm=3&depth_mm=0.5``; `defaults` stand for
    those of the kind.

    Raises
    ------
    InputError
        If it names an unknown property, or a value is out of range.
    """
    pairs = parse_qsl(text.partition("?")[2], keep_blank_values=True)
    try:
        return TypeAdapter(kind).validate_python({**(defaults or {}), **dict(pairs)})
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        if first["type"] == "unexpected_keyword_argument":
            names = [field.name for field in fields(kind)]
            raise InputError.unknown(
                f"`camera`={text}: {name} is no setting", name, names
            ) from None
        raise InputError(f"`camera`={text}: {name}: {first['msg'].lower()}") from None


class Pressed(NamedTuple):
    """The film at a time: height H x W in mm, slope, and `bright`, 1 but less on a marker."""

    height: F4
    slope: F4
    bright: F4


class SimulatedSensor:
    """Film, LEDs and ball.

    Attributes
    ----------
    strength : brightness of each LED, 1 as calibrated; 0 is burnt out
    exposure_s : the scene's exposure, or what its camera's rate allows
    """

    def __init__(self, scene: Scene, start: float | None = None) -> None:
        self.scene = scene
        self.start = time.monotonic() if start is None else start
        self.exposure_s = scene.exposure_s or EXPOSURE_S
        pixel, shape = scene.pixel_size_mm, (scene.height_px, scene.width_px)
        self._x, self._y = image_places(shape, pixel)
        self.lights = scene.lights
        self.strength = np.ones(len(self.lights), np.float32)
        self._lens = _lens_share(shape, scene.vignetting)
        self._bare: F4 = render(np.zeros(shape, np.float32), pixel, self.lights).light * self._lens
        self._ball = _PressedFilm(scene)
        rng = np.random.Generator(np.random.SFC64(scene.seed))
        self._noises = [rng.standard_normal(shape, np.float32) for _ in range(NOISE_IMAGES)]
        self._recent: dict[float, Pressed] = {}

    def place(self, moment: float) -> tuple[float, float, float]:
        """The ball at a time: x and y of its axis from the middle, and its depth; all in mm."""
        scene, since = self.scene, moment - self.start
        if scene.by_hand:
            return self._place_by_hand(since - scene.rest_s)
        turn = 2 * math.pi * since / scene.period_s
        down = 0.5 - 0.5 * math.cos(2 * math.pi * since / scene.press_s)
        x, y = scene.path_mm * math.cos(turn), scene.path_mm * math.sin(turn)
        return x, y, scene.depth_mm * down

    def _place_by_hand(self, since: float) -> tuple[float, float, float]:
        """The ball's position, `since` seconds after the initial rest."""
        scene = self.scene
        count, part = divmod(max(since, 0.0) / scene.press_s, 1)
        # Roberts' sequence: any part of it, with any stride, covers the film evenly.
        x, y = (2 * ((0.5 + step * count) % 1) - 1 for step in (0.7548776662, 0.5698402910))
        down = np.interp(part, (0, 0.1, 0.55, 0.65), (0, 1, 1, 0)) if since > 0 else 0.0
        narrow = scene.height_px / scene.width_px
        return scene.path_mm * x, scene.path_mm * narrow * y, scene.depth_mm * float(down)

    def truth(self, end: float) -> F4:
        """The true height, H x W in mm, for a frame whose exposure ended at `end`."""
        return self.true_height(end - 0.5 * (self.exposure_s + self.scene.readout_s))

    def true_height(self, moment: float) -> F4:
        """The true height at a time, H x W in mm."""
        return self._film(moment).height

    def image(self, shares: Sequence[F4], moment: float, number: int) -> NDArray[np.uint8]:
        """The camera's image.

        Parameters
        ----------
        shares : for each LED, from 1: the share of its light that each row receives, length H
        moment : time that determines the ball's position
        number : selects the noise
        """
        total = np.zeros_like(self._lens)
        for k, share in enumerate(shares):
            if share.any() and self.strength[k]:
                total += self._light(k, moment) * (self.strength[k] * share[:, None])
        return self._recorded(total, number)

    def _film(self, moment: float) -> Pressed:
        film = self._recent.get(moment)
        if film is None:
            film = self._pressed(moment)
            self._recent = dict([*self._recent.items()][-RECENT_FRAMES:]) | {moment: film}
        return film

    def _pressed(self, moment: float) -> Pressed:
        """The film around the ball at a time."""
        x, y, depth = self.place(moment)
        shape = self._ball.surface(self._x - np.float32(x), self._y - np.float32(y), depth)
        return Pressed(*shape, self._brightness(x, y, depth))

    def _light(self, k: int, moment: float) -> F4:
        """H x W, the light of LED k, from 0 (equation N1; no cast shadows)."""
        film = self._film(moment)
        led, pixel = Film.matt(self.lights[k : k + 1]), self.scene.pixel_size_mm
        lit = np.maximum(film_light(film.slope, film.height, led, pixel)[0], 0)
        return np.asarray(self._bare[k] * film.bright * lit)

    def _brightness(self, x: float, y: float, depth: float) -> F4:
        """H x W: 1 on bare film, less on markers, which the ball at (x, y) drags along."""
        scene, bare = self.scene, np.ones_like(self._lens)
        if not scene.marker_pitch_mm:
            return bare
        from tactograph.sdk.nodes import print_markers  # of a ring that may not be there

        (printed,) = print_markers(
            bare[None],
            scene.pixel_size_mm,
            pitch_mm=scene.marker_pitch_mm,
            radius_mm=scene.marker_mm,
            drag_x_mm=scene.drag_mm * depth / max(scene.depth_mm, 1e-9),
            drag_y_mm=0.0,
            center_x_mm=x,
            center_y_mm=y,
            reach_mm=DRAG_REACH_MM,
        )
        return printed

    def _recorded(self, light: F4, number: int) -> NDArray[np.uint8]:
        """Add ambient light, noise and quantisation, as in `expose`."""
        scene = self.scene
        electrons = (light + np.float32(scene.ambient) * self._lens) * np.float32(scene.full_well)
        spread = np.sqrt(electrons + np.float32(scene.read_noise**2))
        electrons += spread * self._noises[number % NOISE_IMAGES]
        levels = electrons * np.float32(MAX_BYTE / scene.full_well) + np.float32(0.5)
        return np.clip(levels, 0, MAX_BYTE).astype(np.uint8)


def _lens_share(shape: tuple[int, int], vignetting: float) -> F4:
    """The light that passes the lens, H x W, as of an evenly lit wall; 1 at the centre."""
    wall = np.zeros((1, *shape), np.float32)
    return expose(
        wall, vignetting=vignetting, ambient=1.0, shot_noise=False, read_noise=0.0, bits=16
    ).dark


class _PressedFilm:
    """The film around a ball, at any depth: `press`, tabulated by distance from the axis."""

    def __init__(self, scene: Scene) -> None:
        radius, deepest = scene.radius_mm, scene.depth_mm
        contact = math.sqrt(max(radius**2 - max(radius - deepest, 0) ** 2, 0))
        reach = contact + REACH_MM
        self._deepest = max(deepest, 1e-9)
        self._step = reach / (RADIUS_SAMPLES - 1)
        half = math.ceil(reach / PAPER_PIXEL_MM) + 1
        at = np.linspace(0, reach, RADIUS_SAMPLES)
        self._height = np.zeros((DEPTH_COUNT, RADIUS_SAMPLES), np.float32)
        self._steepness = np.zeros((DEPTH_COUNT, RADIUS_SAMPLES), np.float32)
        for i in range(1, DEPTH_COUNT):
            rise = deepest * i / (DEPTH_COUNT - 1)
            if not rise:
                continue
            ball = shape_ball(
                radius_mm=radius, rise_mm=rise, width_px=2 * half + 1, height_px=2 * half + 1
            )
            film = press(ball.height, ball.pixel_size)
            section = film[half, half:].astype(np.float64)
            curve = CubicSpline(np.arange(half + 1) * ball.pixel_size, section)
            self._height[i], self._steepness[i] = curve(at), curve(at, 1)
        # At the table's end is no step of a tenth of a micron, and beyond it there is no slope.
        self._height -= self._height[:, -1:]
        self._steepness[:, -1] = 0

    def surface(self, across: F4, down: F4, depth: float) -> tuple[F4, F4]:
        """Height in mm, H x W, and slope, at offsets from the axis, 1 x W and H x 1."""
        distance = np.sqrt(across * across + down * down)
        cell = np.minimum(distance * np.float32(1 / self._step), RADIUS_SAMPLES - 1)
        index = np.minimum(cell.astype(np.intp), RADIUS_SAMPLES - 2)
        share = cell - index.astype(np.float32)
        height, rise = (
            table[index] + share * np.diff(table)[index]
            for table in (self._at_depth(each, depth) for each in (self._height, self._steepness))
        )
        rise /= np.maximum(distance, MIN_AXIS_MM)
        return np.asarray(height, np.float32), np.stack([rise * across, rise * down])

    def _at_depth(self, table: F4, depth: float) -> F4:
        """The table interpolated at a depth."""
        level = min(depth / self._deepest, 1.0) * (DEPTH_COUNT - 1)
        i = min(int(level), DEPTH_COUNT - 2)
        share = np.float32(level - i)
        return table[i] + share * (table[i + 1] - table[i])
