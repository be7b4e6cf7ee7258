"""Random surfaces of touches, and random errors of a film's model."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, FULL_MISFIT_SLOPE, LEVEL_MISFIT_SHARE, Height, Light, Slope
from tactograph.nodes.calibrate import LED_DRIFT, LED_DRIFT_ACROSS
from tactograph.nodes.optics.near_light import places
from tactograph.nodes.slope.height_slopes import height_slopes

FLANK_SLOPES = FULL_MISFIT_SLOPE.item(), 3.0
"""Range of the slopes of an object's flanks, log-uniform: from film that is nearly at rest to the
steepest walls that a soft film covers."""
REACH_SHARES, FOLD_SHARES = (0.15, 0.4), (0.3, 1.0)
"""Half an object's width over the image's shorter side, and half a fold's width over that."""
WIDTH_SHARES = (0.01, 0.3)
"""Range of the width, over the image's, over which errors are alike where none is stated,
log-uniform."""
SKIRT_SHARE = 0.1
"""Width over which film leaves an object, relative to half the object's width."""
Random = np.random.Generator
Form = Callable[[Random, F4, F4, float], F4]


class Drawn(NamedTuple):
    """A surface, the slopes that its light corresponds to, and the light of its film at rest."""

    height: Height
    slope: Slope
    flat: Light


class Doubts(NamedTuple):
    """The uncertainty of a calibration, from its `Misfit` and `Film`, or from that of its light."""

    light: float
    level: float = 0.0
    width_mm: float | None = None
    uneven: float = 0.0
    contact_mm: float = 0.05

    def touch(
        self, rng: Random, number: int, flat: Light, pixel: float, rigid: bool = False
    ) -> Drawn:
        """Return a touch by a ball, edge, fold, groove or dent, shallow or steep, in turn.

        `rigid` objects have walls, which no film covers.
        """
        count, *size = flat.shape
        width = self.width_mm
        if width is None:
            width = pixel * size[1] * math.exp(rng.uniform(*np.log(WIDTH_SHARES)))
        width /= pixel
        height = _surface(rng, size, pixel, OBJECT_FORMS[number % len(OBJECT_FORMS)], rigid)
        slope = _leaning(
            height_slopes(height, pixel).slope, self.level * _field(rng, 2, size, width)
        )
        errors = self.light * _field(rng, count, size, width)
        errors = errors + self.uneven * _field(rng, 1, size, width)
        touched = np.clip(height / np.float32(self.contact_mm), 0, 1)
        gain = (1 + touched * errors) * _drift(rng, count, size)
        return Drawn(height, slope, np.asarray(flat * gain, np.float32))


def _surface(rng: Random, size: list[int], pixel: float, form: Form, rigid: bool) -> Height:
    """The film over an object of random place and orientation, H x W in mm."""
    side = min(size) * pixel
    middle = rng.uniform(-0.5, 0.5, 2) * np.array(size[::-1]) * pixel
    turn = rng.uniform(0, 2 * np.pi)
    half = side * rng.uniform(*REACH_SHARES)
    flank = float(np.exp(rng.uniform(*np.log(FLANK_SLOPES))))
    x, y = np.meshgrid(*(places(count, np.float32(pixel)) for count in size[::-1]))
    across = (x - middle[0]) * np.cos(turn) + (y - middle[1]) * np.sin(turn)
    along = (y - middle[1]) * np.cos(turn) - (x - middle[0]) * np.sin(turn)
    above = flank * form(rng, across, along, half)
    if rigid:
        return np.where(above > 0, above + half * rng.uniform(0, 1), 0).astype(np.float32)
    # A soft maximum of object and film at rest: film falls off as exp(-d / skirt).
    skirt = flank * SKIRT_SHARE * half
    risen = skirt * np.logaddexp(0, above / skirt)
    return cv2.GaussianBlur(risen.astype(np.float32), (0, 0), 1.0)


def _ball(_: Random, x: F4, y: F4, half: float) -> F4:
    """A ball whose flank is 1 where film leaves it; all forms are 0 there."""
    away = np.hypot(x, y)
    cap = np.sqrt(np.maximum(2 * half * half - away * away, half * half)) - half
    return np.asarray(cap - np.maximum(away - half, 0))


def _cone(_: Random, x: F4, y: F4, half: float) -> F4:
    return np.asarray(half - np.hypot(x, y))


def _edge(rng: Random, x: F4, y: F4, half: float) -> F4:
    return np.asarray(half - np.maximum(np.abs(x), np.abs(y) * rng.uniform(*FOLD_SHARES)))


def _plateau(rng: Random, x: F4, y: F4, half: float) -> F4:
    return np.minimum(_edge(rng, x, y, half), half * rng.uniform(*FOLD_SHARES) / 2)


def _groove(rng: Random, x: F4, y: F4, half: float) -> F4:
    period = half * rng.uniform(*FOLD_SHARES)
    ripple = period / (2 * np.pi) * np.cos(2 * np.pi * x / period)
    return np.minimum(ripple, 2 * (half - np.maximum(np.abs(x), np.abs(y))))


def _ridges(rng: Random, x: F4, y: F4, half: float) -> F4:
    """Sharp ridges that end on a circle, like those of a thread or a file."""
    width = half * rng.uniform(*FOLD_SHARES) / 2
    ridge = np.abs((x / width) % 2 - 1) * width
    return np.where(np.hypot(x, y) < half, ridge, half - np.hypot(x, y))


def _dents(rng: Random, x: F4, y: F4, half: float) -> F4:
    places_of = rng.uniform(-1.5, 1.5, (3, 2)) * half
    small = half * rng.uniform(*FOLD_SHARES) / 2
    return np.asarray(np.max([_ball(rng, x - u, y - v, small) for u, v in places_of], axis=0))


def _nothing(_: Random, x: F4, y: F4, half: float) -> F4:
    return np.full(x.shape, -1e3 * half)


OBJECT_FORMS: tuple[Form, ...] = (_ball, _cone, _edge, _plateau, _groove, _dents, _ridges, _nothing)


def _leaning(slope: Slope, error: NDArray[Any]) -> Slope:
    """The slopes of normals with errors that grow with the slope, as those of the model do."""
    squared = (slope * slope).sum(axis=0)
    error = error * np.clip(np.sqrt(squared) / FULL_MISFIT_SLOPE, LEVEL_MISFIT_SHARE, 1)
    return np.asarray(slope + error + slope * (slope * error).sum(axis=0), np.float32)


def _field(rng: Random, count: int, size: list[int], width: float) -> NDArray[Any]:
    """Fields of standard deviation 1, count x H x W, with correlation 1/2 at `width` pixels."""
    if width < 1:
        return rng.standard_normal((count, *size), np.float32)
    # White noise after a Gaussian blur has the correlation exp(-(distance / (2 blur))^2).
    blur = min(width / (2 * math.sqrt(math.log(2))), max(size) / 2)
    # Two samples per blur width suffice for a smooth field.
    step = max(1.0, blur / 2)
    wide, rim = blur / step, int(3 * blur / step) + 1
    rows, columns = (int(np.ceil(side / step)) + 2 * rim for side in size)
    white = rng.standard_normal((count, rows, columns), np.float32)
    planes = [cv2.GaussianBlur(p, (0, 0), wide)[rim:-rim, rim:-rim] for p in white]
    fine = [cv2.resize(p, size[::-1], interpolation=cv2.INTER_CUBIC) for p in planes]
    return np.asarray(np.stack(fine) * (2 * np.sqrt(np.pi) * wide))


def _drift(rng: Random, count: int, size: list[int]) -> NDArray[Any]:
    """The LEDs' light relative to the flat frame; every other touch has no drift."""
    if rng.random() < 1 / 2:
        return np.ones((count, 1, 1))
    u, v = (np.linspace(-1, 1, n) * n / size[1] for n in size[::-1])
    level = rng.normal(1, LED_DRIFT, (count, 1, 1))
    east, south = rng.normal(0, LED_DRIFT_ACROSS, (2, count, 1, 1))
    return np.asarray(level + east * u + south * v[:, None])
