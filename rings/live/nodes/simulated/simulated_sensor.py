"""A simulated sensor: film, LEDs, a ball that is pressed and rolled around, and faults."""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeVar
from urllib.parse import parse_qsl

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass
from scipy.interpolate import CubicSpline

from tactograph.sdk import F4, InputError
from tactograph.sdk.nodes import light_ring, press, print_markers, render, shape_ball
from tactograph.sdk.unstable import (
    PAPER_PIXEL_MM,
    LightPositions,
    expected_light,
    lens_share,
    places,
    vectors_at,
)

MAX_BYTE = 255
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
"""Standard deviation of a drag's fall-off around the ball, cut off at `DRAG_DEVIATIONS` of them."""
DRAG_DEVIATIONS = 4
MIN_AXIS_MM = np.float32(1e-6)
"""Smallest distance from the ball's axis; prevents division by 0."""
RECENT_FRAMES = 8
"""Number of latest films that are kept for the true height."""


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
    text: str, kind: type[SceneKind], known: Mapping[str, Any] | None = None
) -> SceneKind:
    """Read ``simulated`` or ``simulated?radius_mm=3&depth_mm=0.5``; `known` overrides defaults.

    Raises
    ------
    InputError
        If it names an unknown property, or a value is out of range.
    """
    pairs = parse_qsl(text.partition("?")[2], keep_blank_values=True)
    try:
        return TypeAdapter(kind).validate_python({**(known or {}), **dict(pairs)})
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        raise InputError(f"`camera`={text}: {name}: {first['msg'].lower()}") from None


class _Pressed(NamedTuple):
    """The film around the ball: window, positions in mm, height, slope, brightness.

    `bright` is 1 on bare film, and less on a marker.
    """

    rows: slice
    columns: slice
    x: F4
    y: F4
    height: F4
    slope: F4
    bright: F4


class SimulatedSensor:
    """Film, LEDs and ball, and faults that tests can trigger.

    Attributes
    ----------
    plugged : whether its cable is in; if not, no camera can be opened, and an open one fails
    covered, flooded : the lens is covered; stray light saturates the camera
    frozen : the driver hangs: a fetch does not return
    strength : brightness of each LED, 1 as calibrated; 0 is burnt out
    size : width and height that the camera delivers, whatever is requested; None: the scene's
    exposure_s : the scene's exposure, or what its camera's rate allows
    faults : faults of the next frames, one each: "double", "lose", "swap", "late" or "none"
    """

    def __init__(self, scene: Scene, start: float | None = None) -> None:
        self.scene = scene
        self.start = time.monotonic() if start is None else start
        self.plugged = True
        self.covered = False
        self.flooded = False
        self.frozen = False
        self.size: tuple[int, int] | None = None
        self.exposure_s = scene.exposure_s or EXPOSURE_S
        self.faults: deque[str] = deque()
        pixel = scene.pixel_size_mm
        self._x = places(scene.width_px, np.float32(pixel))
        self._y = places(scene.height_px, np.float32(pixel))
        shape = scene.height_px, scene.width_px
        self.lights = scene.lights
        self.strength = np.ones(len(self.lights), np.float32)
        flat = render(np.zeros(shape, np.float32), pixel, self.lights).light
        self._lens = lens_share(shape, scene.vignetting)
        self._unprinted: F4 = np.ones(shape, np.float32)
        self._bare: F4 = flat * self._lens
        self._flat: F4 = self._bare * self._brightness(0.0, 0.0, 0.0)
        self._film = _PressedFilm(scene)
        rng = np.random.Generator(np.random.SFC64(scene.seed))
        self._noises = [rng.standard_normal(shape, np.float32) for _ in range(NOISE_IMAGES)]
        self._resting: dict[tuple[int, int], NDArray[np.uint8]] = {}
        self._pressed: dict[float, _Pressed] = {}

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
        height = np.zeros(self._flat.shape[1:], np.float32)
        pressed = self._press(moment)
        height[pressed.rows, pressed.columns] = pressed.height
        return height

    def image(self, shares: Sequence[F4], moment: float, number: int) -> NDArray[np.uint8]:
        """The camera's image.

        Parameters
        ----------
        shares : for each LED, from 1: the share of its light that each row receives, length H
        moment : time that determines the ball's position
        number : selects the noise
        """
        if self.covered:
            return self._recorded(np.zeros_like(self._lens), number, ...)
        if self.flooded:
            return np.full(self._lens.shape, MAX_BYTE, np.uint8)
        lit = [k for k, share in enumerate(shares) if share.any() and self.strength[k]]
        full = [k for k in lit if (share := shares[k]).min() == share.max() == 1]
        if lit == full and len(lit) < 2:
            recorded = self._at_rest(lit[0] + 1 if lit else 0, number).copy()
            if lit:
                light, part = self._pressed_light(lit[0], moment)
                recorded[part] = self._recorded(light, number, part)
            return recorded
        total = np.zeros_like(self._lens)
        for k in lit:
            light = self._flat[k] * self.strength[k]
            under, part = self._pressed_light(k, moment)
            light[part] = under
            total += light * shares[k][:, None]
        return self._recorded(total, number, ...)

    def _press(self, moment: float) -> _Pressed:
        """The film around the ball at a time; cached for all LEDs and the true height."""
        pressed = self._pressed.get(moment)
        if pressed is None:
            x, y, depth = self.place(moment)
            rows, columns = self._window(x, y)
            at = self._x[columns], self._y[rows]
            bright = self._brightness(x, y, depth)[rows, columns]
            shape = self._film.surface(at[0] - np.float32(x), at[1] - np.float32(y), depth)
            pressed = _Pressed(rows, columns, *at, *shape, bright)
            # Keep only the last few, because a frame's truth is needed soon after the frame.
            self._pressed = dict([*self._pressed.items()][-RECENT_FRAMES:]) | {moment: pressed}
        return pressed

    def _pressed_light(self, k: int, moment: float) -> tuple[F4, tuple[slice, slice]]:
        """Light of LED k around the ball, and its window (equation N1; no cast shadows)."""
        film = self._press(moment)
        around = film.rows, film.columns
        vectors = vectors_at(self.lights[k : k + 1], film.x, film.y[:, None], film.height)
        lit = np.maximum(expected_light(vectors, film.slope)[0], 0)
        return self._bare[k][around] * film.bright * self.strength[k] * lit, around

    def _brightness(self, x: float, y: float, depth: float) -> F4:
        """H x W: 1 on bare film, less on markers, which the ball at (x, y) drags along."""
        scene = self.scene
        if not scene.marker_pitch_mm:
            return self._unprinted
        (printed,) = print_markers(
            self._unprinted[None],
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

    def _at_rest(self, led: int, number: int) -> NDArray[np.uint8]:
        """The untouched film under an LED; computed once per field of noise."""
        key = led, number % NOISE_IMAGES
        if key not in self._resting or (led and self.strength[led - 1] != 1):
            light = self._flat[led - 1] * self.strength[led - 1] if led else 0 * self._lens
            self._resting[key] = self._recorded(light, number, ...)
        return self._resting[key]

    def _recorded(self, light: F4, number: int, part: Any) -> NDArray[np.uint8]:
        """Add ambient light, noise and quantisation, as in `expose`."""
        scene = self.scene
        seen = light + np.float32(scene.ambient) * self._lens[part]
        electrons = seen * np.float32(scene.full_well)
        spread = np.sqrt(electrons + np.float32(scene.read_noise**2))
        electrons += spread * self._noises[number % NOISE_IMAGES][part]
        levels = electrons * np.float32(MAX_BYTE / scene.full_well) + np.float32(0.5)
        return np.clip(levels, 0, MAX_BYTE).astype(np.uint8)

    def _window(self, x: float, y: float) -> tuple[slice, slice]:
        """The rows and columns around the ball's axis that are not at rest."""
        scene = self.scene
        dragged = (
            DRAG_DEVIATIONS * DRAG_REACH_MM if scene.marker_pitch_mm and scene.drag_mm else 0.0
        )
        half = max(self._film.radius_mm, dragged) / scene.pixel_size_mm

        def span(middle: float, size: int) -> slice:
            at = middle / scene.pixel_size_mm + (size - 1) / 2
            first, last = math.floor(at - half), math.ceil(at + half) + 1
            return slice(min(max(first, 0), size - 1), max(min(last, size), 1))

        return span(y, scene.height_px), span(x, scene.width_px)


class _PressedFilm:
    """The film around a ball, at any depth: `press`, tabulated by distance from the axis."""

    def __init__(self, scene: Scene) -> None:
        radius, deepest = scene.radius_mm, scene.depth_mm
        contact = math.sqrt(max(radius**2 - max(radius - deepest, 0) ** 2, 0))
        self.radius_mm = contact + REACH_MM
        self._deepest = max(deepest, 1e-9)
        self._step = self.radius_mm / (RADIUS_SAMPLES - 1)
        half = math.ceil(self.radius_mm / PAPER_PIXEL_MM) + 1
        at = np.linspace(0, self.radius_mm, RADIUS_SAMPLES)
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
        # The window's border is no step of a tenth of a micron, and beyond it there is no slope.
        self._height -= self._height[:, -1:]
        self._steepness[:, -1] = 0

    def surface(self, across: F4, down: F4, depth: float) -> tuple[F4, F4]:
        """Height in mm and slope, H x W and 2 x H x W, at offsets from the ball's axis."""
        across, down = np.meshgrid(across, down)
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
