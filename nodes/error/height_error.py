"""Compute the standard deviation of every height.

Long because every cause of an error has its formula, and all pass through one solver, on the host
and on the device.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge, Interval
from scipy.special import digamma, ndtr, stdtrit

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.cores import cores
from tactograph.nodes import (
    BAND_DEVIATIONS,
    F4,
    Blur,
    Film,
    Height,
    HeightError,
    Labels,
    Light,
    Misfit,
    NoiseCorrelation,
    Slope,
)
from tactograph.nodes.error._edge_errors import RESOLVED_BEND, edge_deviation_px, largest_bend
from tactograph.nodes.error._random_errors import ERROR_COUNT, RISE_SIGNS, drawn, key_of, kinds
from tactograph.nodes.error._slope_errors import Causes, Unperturbed, mixing, slope_errors
from tactograph.nodes.height.height_equations import STATE_FREE, HeightSystem
from tactograph.nodes.height.height_levels import levels_of
from tactograph.nodes.height.height_networks import HeightNetworks
from tactograph.nodes.height.height_solver import HeightSolver
from tactograph.nodes.height.height_system import example_system
from tactograph.nodes.height.spring_cells import cells_of
from tactograph.nodes.height.springs import Springs, conjugate_gradients, hierarchy
from tactograph.nodes.optics.coat import upload_curve
from tactograph.nodes.optics.near_light import places

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import DeviceArray, Launch

CPU_GROUP_ITEMS = 4
"""Work-items of a group on a CPU, where each needs much data."""
SPREAD_PX = 3.0
"""Standard deviation of the Gaussian that averages the variance's logarithm over neighbours."""
LEAST_VARIANCE = np.float32(1e-20)
"""Lower bound on a variance, in mm^2, before its logarithm."""
LOG_BIAS = np.float32(math.log(ERROR_COUNT / 2) - digamma(ERROR_COUNT / 2))
"""By how much the mean logarithm of a mean of ERROR_COUNT squares is too small (chi-squared)."""
MIN_ENERGY_SHARE = 1e-6
"""Stop when the remaining gain is less than this share of the steps' energy."""
STUDENT_FACTOR = np.float32(stdtrit(ERROR_COUNT, ndtr(BAND_DEVIATIONS)) / BAND_DEVIATIONS)
"""Student's quantile over the normal quantile at the end of the 90 % band: a variance estimated
from draws has as many degrees of freedom as there are draws."""
Wants = tuple[F4, F4, F4]
"""The springs' target steps to the right and down, and their target rises, in mm."""


@node(
    tolerance=Close(
        1e-6,
        2e-3,
        share=2e-4,
        why="conjugate gradients sum in another order; two LEDs may be nearly in line",
    ),
    sizes={"K": SizeLimit(1, 8, "a label holds a bit for each of at most 8 LEDs")},
)
def height_error(
    height: Height,
    slope: Slope,
    system: HeightSystem,
    sigma: Light,
    used: Labels,
    film: Film,
    misfit: Misfit,
    apparent: Slope,
    bounced: Light | None = None,
    own_bounce: Light | None = None,
    correlation: NoiseCorrelation | None = None,
    blur: Blur | None = None,
    tilt: Slope | None = None,
    *,
    steps: Annotated[int, Interval(ge=8, le=1000)] = 8,
    seed: Annotated[int, Ge(0)] = 1,
) -> HeightError:
    """Return the standard deviation of the height, by propagating errors through the solver.

    For given weights the height is linear in the slopes and rises (H2).  A few random errors of the
    right size are integrated like slopes, on cells of 2 x 2 pixels (`spring_cells`).  The mean
    square of the results is the variance.  Its logarithm is averaged over neighbours, so that the
    large errors of a rim do not spread to the film around it.  The errors are

    - the noise of each LED's light, independent from pixel to pixel.  A height is a sum of slopes,
      so the noise of a mean over pixels counts.  The calibration measures it on light divided by
      the flat frame (`noise_correlation`), so it includes the correlation of neighbours and the
      flat frame's noise.  A factor from Student's distribution accounts for the few draws;
    - an error of the calibration, common to all pixels: the first-order change of the film's
      light for other LED positions within the calibration's error (on the film at rest the flat
      frame cancels it);
    - an error of the film's model: normals lean by the residual on held-out presses and on this
      touch.  The errors are waves of two lengths in four directions, each in two phases a quarter
      of a wave apart, so that their squares have a constant sum.  Only the component along the
      wave changes a height, which is half of such a field.  In a second error all normals are too
      steep, or too flat;
    - two errors of the light from film to film: the share by which the calibration's presses
      disagree about it; and the difference of what was subtracted, which follows from the height
      before, from that of this height;
    - an error of each LED's light, common to all pixels: the departure of the film at rest, since
      LEDs drift, and the light that a touch throws on the film around it is not well known;
    - the difference between a pixel's mean slope and the slope of its mean normal, whose expansion
      fails across an edge; what folds hide under a coat (`folds`); and the effect of a blur: to
      second order light changes by half the blur's variance times the Laplacian of the light of the
      slopes, and more under a coat (`mixing`).  Where `sharpen_slope` undoes it, a part is left;
    - errors of the shadows' rises: an independent error, and the departure of the height from the
      rise.  At a rim that no pixel resolves, slopes pull the height down, with everything that
      stands on the rim.  In a gel that diffuses light shadows end softly, and the departure is an
      error of the rise;
    - where the slope differs by more than a half from pixel to pixel: the edge may lie anywhere
      in the pixel, or as far away as the blur spreads it.

    The eight positions of the LEDs are chosen so that the squares of the calibration's errors
    add up exactly.  On the film at rest the error is zero, because the height is held at zero;
    `doubt_rest` replaces that zero, and adds the errors that all heights share.

    Parameters
    ----------
    height : H x W in mm, as integrated
    slope : 2 x H x W, as given to `height_system`, sharpened by `sharpen_slope`
    system : the equations from which the height was integrated
    sigma : K x H x W, the standard deviation of the light
    used : H x W, the LEDs that the slope was found with
    film : the LEDs' positions, the alternatives within their error, and the film's unevenness
    misfit : length 5, the errors of the film's model (`touch_misfit`)
    apparent : 2 x H x W, the slopes of the pixels' mean normals, before `pixel_mean_slope`
    bounced, own_bounce
        K x H x W, the light from film to film that was subtracted from the light, and that of this
        height.
    correlation
        Correlation of the noise of neighbours, from `noise_correlation`; None: independent noise.
    blur : of the camera in px; None: the camera is sharp
    tilt : 2 x H x W, slopes of the film at rest; None: a plane
    steps : conjugate-gradient steps for each error
    seed : seed of the random errors

    Returns
    -------
    H x W, one standard deviation in mm.
    """
    window, (rows, columns) = system.window, height.shape
    _, rise_error, robust, pixel = (np.float32(number) for number in system.scales)
    thrown = np.zeros_like(sigma) if bounced is None else bounced
    plain = Unperturbed(
        window.of(sigma),
        window.of(slope),
        window.of(height),
        places(columns, pixel)[None, window.columns],
        places(rows, pixel)[window.rows, None],
        window.of(used),
        system.state == STATE_FREE,
        window.of(thrown),
        window.of(thrown - (thrown if bounced is None or own_bounce is None else own_bounce)),
        window.of(slope if tilt is None else slope - tilt),
        window.of(slope - apparent),
    )
    inside = system.cut(height)
    *_, residual = system.residuals(inside)
    residual *= not film.diffuse.any()
    shared = STUDENT_FACTOR * np.float32(math.sqrt(correlation or 1.0))
    causes = Causes(film, misfit, shared, pixel, *mixing(film.refraction, blur))
    slopes = slope_errors(plain, causes, seed)

    def random_load(number: int) -> Wants:
        (p, q), half = slopes[number], pixel / 2
        rises = drawn(key_of(seed, number), residual.shape, first=slopes[0].size)
        rise = rise_error * rises + RISE_SIGNS[number] * residual
        return (p[:, 1:] + p[:, :-1]) * half, (q[1:] + q[:-1]) * half, rise

    springs = system.springs(inside, float(robust))
    total = _variance(springs, random_load, steps)
    deviation = _smooth_deviation(total, plain.free.astype(np.float32))
    beyond = np.maximum(largest_bend(height) - RESOLVED_BEND * pixel, np.float32(0))
    edge = window.of(beyond * edge_deviation_px(blur or 0.0))
    out = np.zeros_like(height)
    out[window] = np.hypot(deviation, edge) * plain.free
    return out


def _variance(springs: Springs, random_load: Callable[[int], Wants], steps: int) -> F4:
    """The variance of the height under the random loads, in mm^2."""
    cells = cells_of(springs) if len(levels_of(*springs.shape)) > 1 else None
    levels = hierarchy(springs if cells is None else cells.springs)
    start = np.zeros(levels[0].shape, np.float32)

    def squared(number: int) -> F4:
        wants = random_load(number)
        wants = wants if cells is None else cells.wants(*wants)
        enough = MIN_ENERGY_SHARE * levels[0].energy(*wants[:2])
        change = conjugate_gradients(levels, levels[0].pull(*wants), start, steps, enough)
        return change * change

    with ThreadPoolExecutor(cores()) as threads:
        total = np.sum([*threads.map(squared, range(ERROR_COUNT))], axis=0) / ERROR_COUNT
    return total if cells is None else cells.on_pixels(total)


def _smooth_deviation(variance: F4, free: F4) -> F4:
    """The square root of the variance's geometric mean over neighbours that are free."""
    total = cv2.GaussianBlur(np.log(np.maximum(variance, LEAST_VARIANCE)) * free, (0, 0), SPREAD_PX)
    weight = np.maximum(cv2.GaussianBlur(free, (0, 0), SPREAD_PX), np.float32(1e-3))
    return np.asarray(np.exp((total / weight + LOG_BIAS) / 2) * free, np.float32)


@height_error.opencl()
def _launch(run: Launch) -> None:
    """Propagate the same errors through the same networks, without a download of pixels."""
    inputs, settings = run.inputs, run.settings
    networks = HeightNetworks(run, with_cells=True)
    solver = HeightSolver(run, networks)
    inside = networks.cut(inputs["height"])
    networks.weigh(inside, networks.robust)
    shape, ties, cells = networks.shape, networks.rises, networks.cells
    coarse = networks.pixels if cells is None else cells
    wants = networks.room(networks.pixels, ERROR_COUNT if cells is None else 1)
    of_cells = wants if cells is None else networks.room(cells, ERROR_COUNT)
    keys = [np.uint32(key_of(settings["seed"], number)) for number in range(ERROR_COUNT)]
    # After the networks are built, so that the slopes are still in the cache.
    slopes = _launch_slopes(run, networks, keys)
    for number in range(ERROR_COUNT):
        to = number if cells is None else 0
        run.kernel(
            "err_steps", run.in_row_lanes(*shape),
            slopes, wants.right, wants.down, *shape, number, to, networks.pixel,
        )  # fmt: skip
        if ties:
            run.kernel(
                "err_rises", (ties,), wants.rise, networks.wants.rise, inside,
                networks.finest_ends, inputs["film.diffuse"], run.sizes["K"], ties, to,
                networks.rise_error, float(RISE_SIGNS[number]), 2 * math.prod(shape), keys[number],
            )  # fmt: skip
        if cells is not None:
            networks.wants_of_cells(wants, of_cells, number)
    enough = networks.enough(MIN_ENERGY_SHARE, coarse, of_cells, ERROR_COUNT)
    coarse_errors, mean = run.scratch((ERROR_COUNT, *coarse.shape)), run.scratch(coarse.shape)
    solver.solve_all(coarse, of_cells, coarse_errors, settings["steps"], enough)
    size = math.prod(coarse.shape)
    run.kernel("mean_square", run.in_lanes(size), coarse_errors, mean, size, ERROR_COUNT)
    total = mean
    if cells is not None:
        total = run.scratch(shape)
        networks.on_pixels(mean, total)
    _deviate(run, networks, total)


def _launch_slopes(run: Launch, networks: HeightNetworks, keys: list[np.uint32]) -> DeviceArray:
    """All errors of the slopes inside the window: ERROR_COUNT x 2 x rows x columns."""
    inputs = run.inputs
    frame = tuple(run.sizes[symbol] for symbol in "KHW")
    slopes = run.scratch((ERROR_COUNT, 2, *networks.shape))
    spread, folded = mixing(inputs["film.refraction"], inputs.get("blur"))
    # A separate launch, since neighbours read its light; a coat takes half of the time.
    light, blunt = run.scratch((frame[0], *networks.shape)), run.scratch(networks.shape)
    run.kernel(
        "shine", run.in_row_lanes(*networks.shape),
        *(inputs[name] for name in ("sigma", "height", "slope", "used", "film.lights")),
        upload_curve(run, inputs["film.roughness"], inputs["film.refraction"]),
        *(inputs[f"film.{name}"] for name in ("base", "roughness", "camera", "refraction")),
        inputs["film.diffuse"], light, blunt, *frame, *networks.place, networks.pixel,
        local=(CPU_GROUP_ITEMS,) if run.lanes > 1 else None, constants={"LEDS": frame[0]},
    )  # fmt: skip
    run.kernel(
        "err_slopes", run.in_row_lanes(*networks.shape),
        *(inputs[name] for name in ("sigma", "height", "slope")), networks.state,
        *(inputs[name] for name in ("used", "film.lights", "film.other_lights")), light, blunt,
        slopes, *frame, *networks.place, networks.pixel,
        float(STUDENT_FACTOR) * math.sqrt(inputs.get("correlation") or 1.0),
        inputs["film.uneven"], float(spread / 2), int(folded),
        run.keep("kinds", lambda: run.put(kinds())), run.put(np.array(keys)), inputs["misfit"],
        inputs["apparent"], *(inputs.get(name) for name in ("bounced", "own_bounce", "tilt")),
        inputs["film.diffuse"], inputs["film.refraction"],
        # The data of a work-item fill a cache, and a CPU holds those of all items of a group.
        local=(CPU_GROUP_ITEMS,) if run.lanes > 1 else None, constants={"LEDS": frame[0]},
    )  # fmt: skip
    return slopes


def _deviate(run: Launch, networks: HeightNetworks, total: DeviceArray) -> None:
    """Write the result of `_smooth_deviation` to the output."""
    shape, frame = networks.shape, (run.sizes["H"], run.sizes["W"])
    # The radius of OpenCV's Gaussian for floats: four standard deviations.
    radius = round(4 * SPREAD_PX)
    kernel = cv2.getGaussianKernel(2 * radius + 1, SPREAD_PX, cv2.CV_32F)
    taps = run.keep("taps", lambda: run.put(kernel.ravel()))
    free, half, weight = (run.scratch(shape) for _ in range(3))
    run.kernel("free_logarithm", shape, networks.state, total, free, *shape, LEAST_VARIANCE)
    by_rows = run.in_row_lanes(*shape)
    for source, target in ((free, weight), (total, total)):
        run.kernel("blur", by_rows, source, taps, half, *shape, radius, 1)
        run.kernel("blur", by_rows, half, taps, target, *shape, radius, 0)
    out, inputs = run.outputs["height_error"], run.inputs
    blur = inputs.get("blur") or 0.0
    run.kernel("clear", run.in_lanes(math.prod(frame)), out, math.prod(frame))
    run.kernel(
        "deviation", by_rows, total, weight, free, inputs["height"], out,
        *frame, *networks.place, networks.pixel, float(edge_deviation_px(blur)), LOG_BIAS,
    )  # fmt: skip


@height_error.example
def _example(rng: np.random.Generator, **sizes: int) -> dict[str, Any]:
    """A touch with some film at rest around it, and shadows, most of which agree with it."""
    rows, columns, lights = sizes["H"], sizes["W"], sizes["K"]
    around = rng.uniform(0, 2 * np.pi, lights)
    places = np.stack([20 * np.cos(around), 20 * np.sin(around), 0 * around + 8], axis=1)
    shape = rows, columns
    # Level film on the left; an unresolved edge in the middle.
    rising = np.linspace(0, 1, columns)
    height = 0.01 * np.sin(np.arange(rows) / 9)[:, None] + 0.3 * (rising > 0.5)
    turns = rng.uniform(0, 6, (2, 1, 1)) + np.arange(rows)[:, None]
    slope = (3 * rising * np.sin(turns)).astype(np.float32)
    system = example_system(rng, slope, **sizes)
    equations = HeightSystem(**{name: system[f"system.{name}"] for name in HeightSystem._fields})
    *_, departs = equations.residuals(equations.cut(height.astype(np.float32)))
    system["system.rise"] += departs * (rng.random(departs.size) < 0.7)
    return {
        **system,
        "misfit": np.array([0.003, 1, 0.002, 0.05, 0.002], np.float32),
        "slope": slope,
        "height": np.asarray(height, np.float32),
        "sigma": rng.uniform(1e-3, 1e-2, (lights, *shape)).astype(np.float32),
        "used": rng.integers(0, 1 << lights, shape).astype(np.uint8),
        "film.lights": places.astype(np.float32),
        "film.other_lights": np.float32(places * rng.uniform(0.99, 1.01, (ERROR_COUNT, lights, 3))),
        "film.diffuse": np.float32(rng.choice([0.0, 0.1])) * np.ones(lights, np.float32),
        "film.refraction": float(rng.choice([1.0, 1.5])),
        "correlation": float(rng.uniform(1, 4)),
        "blur": float(rng.uniform(0, 1)),
        "tilt": rng.normal(0, 0.2, (2, *shape)).astype(np.float32),
        "apparent": (0.98 * slope).astype(np.float32),
    }
