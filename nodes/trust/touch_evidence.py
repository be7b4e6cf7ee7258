"""Reduce the maps of a touch to the few figures that its verdict rests on.

Long because one node reduces curl, light and film at rest, so that the host waits for the device
once.
"""

from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import F4, FULL_MISFIT_SLOPE, CoarseLight, Height, Labels, Light, Slope
from tactograph.nodes.light.border import border_level
from tactograph.nodes.light.film_drift import CALM_DEPARTURES, DRIFT_TERMS, Drift, drift_gain
from tactograph.nodes.trust.checked_cells import (
    DARK_LIGHT,
    MIN_CELLS,
    MIN_LEDS,
    quarter_of,
    thinned,
    thinning,
)
from tactograph.nodes.trust.light_departure import Brighter, Departure
from tactograph.nodes.trust.slope_curl import CoarseCurl

CURL_BANDS = 9
"""Bands of rows; a camera reads a frame row by row, so some bands may be of another image."""
MAX_SQUARED_BEND = np.float32(0.16)
"""Squared bend beyond which a cell may hold an edge, and its light be that of two normals."""
RestLevel = Annotated[F4, Port("K", "1", low=0.9, high=1.1)]
"""Each LED's light on the film at rest, relative to the flat frame."""


class TouchFigures(NamedTuple):
    """The figures of a touch; touched film is steeper than `FULL_MISFIT_SLOPE`."""

    curl: float
    """Curl of the slopes over the expected curl (T2)."""
    shape: float
    """Greatest change of an LED's light across the image, on the film at rest (T3)."""
    calm: float
    """Share of the image at rest."""
    dark: float
    """Share of the image that is black relative to the rest of the touch."""
    lowest: float
    """Height in mm."""
    highest: float
    at_rest: float
    """Median departure of the light of untouched film (T1)."""
    of_touch: float
    """Upper quartile of the departure of the light of touched film."""
    dim: float
    """Lower quartile of the light in shadow, converted to a matt film's."""
    brighter: float
    """Median excess of the brightness of touched film over the prediction of its slopes (T4)."""
    dirty: float
    """Number of cells that lack too much light under all LEDs; -1: the light is not checked."""


class TouchEvidence(NamedTuple):
    """The input of `judge_touch`, in as few small arrays as possible, for reading from a device."""

    level: RestLevel
    figures: Annotated[F4, Port("11", "1", low=0, high=5)]
    """The values of `TouchFigures`, in order."""

    def read(self) -> TouchFigures:
        """Return the figures by name."""
        return TouchFigures(*self.figures.tolist())


@node(
    sizes={"K": SizeLimit(1, 8, "labels have 8 bits")},
    tolerance=Close(1e-5, 1e-3, why="a device finds quantiles to less than the last bits"),
)
def touch_evidence(
    curl: CoarseCurl,
    light: CoarseLight,
    height: Height,
    drift: Drift | None = None,
    departure: Departure | None = None,
    brighter: Brighter | None = None,
    slope: Slope | None = None,
    used: Labels | None = None,
    matt: Light | None = None,
    shadow: Labels | None = None,
    *,
    max_dimming: Annotated[float, Interval(gt=0, le=1)] = 0.3,
) -> TouchEvidence:
    """Return the figures of a touch that speak for it or against it (T1 to T5).

    Parameters
    ----------
    curl : h x w, from `slope_curl`
    light : K x h x w on cells, relative to the flat frame, before drift is removed
    height : H x W in mm
    drift : K x 6, from `film_drift`
    departure, brighter
        H x W, from `light_departure`.  Without departure and slope the light is not checked.
    slope, used, shadow
        2 x H x W and H x W: the slopes, the LEDs that they rest on, and the LEDs that do not light
        a pixel.
    matt : K x H x W, the light converted to a matt film's
    max_dimming : share of the light that film may lack under all LEDs
    """
    of_light: tuple[float, ...] = 0.0, 0.0, 0.0, 0.0, -1.0
    if departure is not None and slope is not None:
        of_light = _of_light(departure, slope, brighter, used, matt, shadow, max_dimming)
    level, of_film = _of_film(light, height, drift)
    return TouchEvidence(level, np.array([curl_evidence(curl), *of_film, *of_light], np.float32))


def curl_evidence(curl: CoarseCurl) -> float:
    """Return the greatest mean curl of a band of rows (T2)."""
    cells = thinned(curl)
    tested, curls = cells >= 0, np.sqrt(np.maximum(cells, 0))
    starts = np.arange(CURL_BANDS + 1) * len(cells) // CURL_BANDS
    bands = (np.s_[start:end] for start, end in pairwise(starts))
    # The offset keeps a band of few cells from standing out by chance.
    return max(float(curls[b].sum() / (tested[b].sum() + MIN_CELLS)) for b in bands)


def _of_film(
    light: CoarseLight, height: Height, drift: Drift | None
) -> tuple[RestLevel, tuple[float, ...]]:
    """The light of the film at rest, and the figures of the film and the height (T3).

    Without a drift, or if none was found, each LED's light is the median of the frame's border.
    """
    cells, shape = thinned(light), 0.0
    if drift is not None and (drift[:, 0] != 1).any():
        level, shape = drift[:, 0], np.abs(drift[:, 1:]).max()
        even = cells / drift_gain(drift, cells.shape[1:])
    else:
        level = border_level(cells)
        even = cells / np.maximum(level, DARK_LIGHT)[:, None, None]
    dark = (even < DARK_LIGHT).all(axis=0).mean()
    calm = (np.abs(even - 1) < CALM_DEPARTURES[0]).all(axis=0).mean()
    return level, (shape, calm, dark, height.min(), height.max())


def _of_light(
    departure: Departure,
    slope: Slope,
    brighter: Brighter | None,
    used: Labels | None,
    matt: Light | None,
    shadow: Labels | None,
    max_dimming: float,
) -> tuple[float, ...]:
    """The figures of the light (T1, T4).

    If three quarters of the touched film may hold edges, as under a fine grating, its light is not
    compared.  Figures of fewer than `MIN_CELLS` cells, or of missing inputs, are 0.
    """
    bend = thinned(_squared_bend(slope))
    departs, (p, q) = thinned(departure), thinned(slope)
    steep, tested = p * p + q * q > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE, departs >= 0
    edges, cells = (np.count_nonzero(some) for some in (bend[steep] > MAX_SQUARED_BEND, steep))
    compared = np.bool_(4 * edges <= 3 * cells)
    at_rest, of_touch = departs[tested & ~steep], departs[tested & steep & compared]
    dim = middle = dirty = 0.0
    if matt is not None and shadow is not None:
        dim = quarter_of(_light_in_shadow(thinned(matt), thinned(shadow)), 1)
    if brighter is not None:
        excess = thinned(brighter)
        lit = np.bool_(True) if used is None else np.bitwise_count(thinned(used)) >= MIN_LEDS
        dirty = int((lit & (excess < -np.float32(max_dimming))).sum())
        # Images that are alike show level film that is too dark.
        touched = compared & lit & (steep | (np.abs(excess) > FULL_MISFIT_SLOPE))
        middle = quarter_of(excess[touched], 2)
    rest, upper = np.sqrt([quarter_of(at_rest, 2), quarter_of(of_touch, 3)])
    return rest, upper, dim, middle, dirty


def _squared_bend(slope: F4) -> F4:
    """The squared second difference of the slope over two cells, H x W."""
    bend = np.zeros(slope.shape[1:], np.float32)
    across = slope[:, :, 4:] + slope[:, :, :-4] - 2 * slope[:, :, 2:-2]
    down = slope[:, 4:] + slope[:, :-4] - 2 * slope[:, 2:-2]
    bend[:, 2:-2] += (across * across).sum(axis=0)
    bend[2:-2] += (down * down).sum(axis=0)
    return bend


def _light_in_shadow(light: F4, shadow: Labels) -> F4:
    """The mean light of the LEDs that do not reach a cell, for cells with such LEDs."""
    dark = shadow >> np.arange(len(light), dtype=np.uint8)[:, None, None] & 1
    count = dark.sum(axis=0)
    mean = (light * dark).sum(axis=0) / np.maximum(count, np.float32(1))
    return np.asarray(mean[count > 0], np.float32)


@touch_evidence.opencl()
def _launch(run: Launch) -> None:
    """One work-group reduces the light, one the film; more of them find quantiles and bands."""
    count, height, width = (run.sizes[name] for name in "KHW")
    step, group, options = thinning(height, width), (run.group,), run.inputs
    thin = (-(-height // step), -(-width // step))
    (curl, light), cells = _thinned(run, options["curl"], options["light"])
    values, gains = run.scratch((4, *thin)), run.scratch((count, DRIFT_TERMS))
    names = ("departure", "brighter", "slope", "used", "matt", "shadow")
    level, figures = run.outputs.values()
    planes = *(options.get(name) for name in names), light, options["height"], options.get("drift")
    scratch = values, run.scratch(cells), gains
    sizes = count, height, width, *thin, step, *cells
    arguments = *planes, *scratch, level, figures, *sizes, run.settings["max_dimming"]
    run.kernel("look", (2 * run.group,), *arguments, local=group)
    weighed = values, curl, figures, thin[0] * thin[1], *cells
    run.kernel("weigh", (5 * run.group,), *weighed, local=group)


def _thinned(run: Launch, *planes: DeviceArray) -> tuple[list[DeviceArray], tuple[int, int]]:
    """Every n-th row and column of planes, and the new size."""
    rows, columns = (run.sizes[name] for name in "hw")
    step = thinning(rows, columns)
    size = (-(-rows // step), -(-columns // step))
    thinned = []
    for plane in planes:
        count = plane.shape[0] if len(plane.shape) > 2 else 1
        thin = plane if step == 1 else run.scratch((count, *size))
        if step > 1:
            run.kernel("thin", (count, *size), plane, thin, count, *size, rows, columns, step)
        thinned.append(thin)
    return thinned, size


@touch_evidence.example
def _example(
    rng: np.random.Generator, K: int, H: int, W: int, h: int, w: int, **_: int
) -> dict[str, Any]:
    """Film that is steep in narrow or wide bands, or rippled, with shadows.

    The LEDs have drifted; a quarter of the film is touched and some of it black.  Slopes curl at
    random, more in one part of the image, and not at all in some rows.
    """
    curl = rng.chisquare(1, (h, w)) * np.where(np.arange(w) < w / 2, 1, 6)
    curl *= rng.choice([0, 1, 1], (h, 1))
    drift = np.zeros((K, DRIFT_TERMS))
    drift[:, 0] = rng.uniform(0.95, 1.05, K) if rng.random() < 0.5 else 1
    drift[:, 1:] = rng.uniform(-0.01, 0.01, (K, DRIFT_TERMS - 1))
    light = 1 + rng.normal(0, 0.015, (K, h, w))
    light[:, : h // 2, : w // 2] *= rng.uniform(0.3, 1.5, (K, h // 2, w // 2))
    light[:, :, w - w // 8 :] = 0.01
    width, folded = rng.choice([3, 3, 9]), rng.random() < 0.5
    along = np.arange(W) if rng.random() < 0.5 else np.arange(H)[:, None]
    band = along % (3 * width) < width
    ripple = 0.3 + rng.choice([0.075, 0.2]) * (-1.0) ** (along // 2)
    shape = 0.4 * band * (1 + folded) if rng.random() < 0.7 else ripple
    slope = rng.uniform(-0.02, 0.02, (2, H, W)) + shape
    every, shade = (1 << K) - 1, rng.random((H, W)) < rng.choice([0.05, 0.05, 0.5]) * band
    return {
        "curl": np.where(rng.random((h, w)) < rng.choice([0.7, 0.2]), curl, -1),
        "light": light,
        "drift": drift,
        "departure": np.where(
            rng.random((H, W)) < 0.9, rng.chisquare(2, (H, W)), rng.choice([-1, -0.5], (H, W))
        ),
        "slope": slope,
        "brighter": rng.normal(0.01, 0.1, (H, W)),
        "matt": rng.normal(1, 0.08, (K, H, W)) + 0.3 * band,
        "used": np.where(shade, every & 3, every),
        "shadow": np.where(shade, 3, 0),
    }
