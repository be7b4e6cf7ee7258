"""Gather the weighted equations for the height: steps between neighbours, rises, film at rest."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, I4, Mask, PixelSize, ShadowRises, Slope, SlopeVariance
from tactograph.nodes.height.height_equations import (
    STATE_AWAY,
    STATE_FREE,
    STATE_REST,
    HeightSystem,
    Window,
)

MARGIN_PX = 8
"""Width in pixels of the margin around touched film."""
UNKNOWN_VARIANCE = np.float32(1e6)
"""Variance above which a slope is unknown."""
MAX_CUBIC_VARIANCE = np.float32(1)
"""Variance up to which a slope enters the cubic."""
LONE_SLOPE_VARIANCE = np.float32(4)
"""Additional variance of a step of which only one slope is known."""
MAX_LONE_VARIANCE = np.float32(1e3)
"""Upper bound on that slope's variance."""


@node(tolerance=Close(1e-6, 1e-5, why="a device rounds sums differently"))
def height_system(
    slope: Slope,
    variance: SlopeVariance,
    rest: Mask,
    pixel: PixelSize,
    rises: ShadowRises | None = None,
    mask: Mask | None = None,
    *,
    robust: Annotated[float, Ge(0.1)] = 2.5,
    bend: Annotated[float, Ge(0)] = 0.25,
    floor: Annotated[float, Ge(0.01)] = 0.07,
    rise_px: Annotated[float, Ge(0.05)] = 0.5,
) -> HeightSystem:
    """Gather the equations that `integrate_weighted` and `height_error` solve (equation H1).

    They cover the smallest window around all pixels that count and are not at rest, with a margin.

    Parameters
    ----------
    slope, variance : 2 x H x W; the variance of p and q
    rest : H x W, 1 on the film at rest, whose height is zero
    pixel : mm per px
    rises : the C measurements of `shadow_constraints`; None: there are none
    mask : H x W, 1 on the pixels that count; None: all count
    robust
        c of Cauchy's rho, in standard deviations: equations with larger residuals lose their
        weight.
    bend : error of a step, in px, per difference of the slopes at its ends
    floor : error of every step, in px; limits the contrast of the weights
    rise_px : standard deviation of a shadow's rise, in px

    Returns
    -------
    The system; T of the C rises have both ends inside the window.
    """
    states, window, anchored = _touched_window(rest, mask)
    state, slopes = window.of(states), window.of(slope)
    variances = np.where(state == STATE_AWAY, np.float32(np.inf), window.of(variance))
    right, right_variance = _steps(slopes[0], variances[0], bend, floor, np.float32(pixel))
    down, down_variance = _steps(slopes[1].T, variances[1].T, bend, floor, np.float32(pixel))
    pixels = right, down.T, right_variance, down_variance.T, state
    ends = _rises_inside(window, rises or ShadowRises.none(), rest.shape[1], mask)
    constants = _constants(window, anchored, floor, rise_px, robust, pixel)
    return HeightSystem(*pixels, *ends, *constants)


def _touched_window(rest: Mask, mask: Mask | None) -> tuple[NDArray[np.uint8], Window, bool]:
    """The states of the frame's pixels, the window, and whether film is at rest."""
    states = np.where(rest != 0, np.uint8(STATE_REST), np.uint8(STATE_FREE))
    if mask is not None:
        states[mask == 0] = STATE_AWAY
    touched = states == STATE_FREE
    window = Window(_span(touched.any(axis=1)), _span(touched.any(axis=0)))
    return states, window, bool((states == STATE_REST).any())


def _span(touched: NDArray[Any]) -> slice:
    """The window's rows (or columns): the touched ones with a margin; a few if none is touched."""
    numbers = np.flatnonzero(touched)
    first, last = (int(numbers[0]), int(numbers[-1])) if numbers.size else (0, 0)
    return slice(max(first - MARGIN_PX, 0), min(last + 1 + MARGIN_PX, touched.size))


def _steps(slope: F4, variance: F4, bend: float, floor: float, pixel: np.float32) -> tuple[F4, F4]:
    """Steps along the rows in mm, from the slopes at both ends, and their variances.

    On smooth film a cubic through four slopes weights them by (-1, 9, 9, -1) / 16; elsewhere
    two slopes are used.  If only one slope is known, it is used with little weight.  The variance
    of a step is infinite if that of a slope is, and for the step beyond the last pixel.
    """
    before, after = slope[:, :-1], slope[:, 1:]
    of_before, of_after = variance[:, :-1], variance[:, 1:]
    step = 0.5 * (before + after)
    step[:, 1:-1] += _cubic_part(slope, variance)
    turn = np.float32(bend) * (after - before)
    both_known = 0.25 * (of_before + of_after) + turn * turn
    surer = np.where(of_before < of_after, before, after)
    # The pixel that shows a wall also holds its end.
    least = np.minimum(np.minimum(of_before, of_after), MAX_LONE_VARIANCE)
    little = least + LONE_SLOPE_VARIANCE + surer * surer
    alone = np.where(np.isinf(both_known), both_known, little)
    is_known = np.maximum(of_before, of_after) < UNKNOWN_VARIANCE
    steps = np.where(is_known, step, surer) * pixel
    variances = (np.where(is_known, both_known, alone) + np.float32(floor * floor)) * pixel * pixel
    beyond = (0, 0), (0, 1)
    return np.pad(steps, beyond), np.pad(variances, beyond, constant_values=np.inf)


def _cubic_part(slope: F4, variance: F4) -> F4:
    """What the cubic adds to the mean of the inner two slopes: at most 1/4 of their difference."""
    before, after = slope[:, 1:-2], slope[:, 2:-1]
    curve = (before + after - (slope[:, :-3] + slope[:, 3:])) / np.float32(16)
    limit = 0.25 * np.abs(after - before)
    smooth = (variance[:, :-3] < MAX_CUBIC_VARIANCE) & (variance[:, 3:] < MAX_CUBIC_VARIANCE)
    return np.where(smooth, np.clip(curve, -limit, limit), np.float32(0))


def _rises_inside(
    window: Window, rises: ShadowRises, columns: int, mask: Mask | None
) -> tuple[I4, I4, F4]:
    """The rises with both ends in the window and counted; ends are numbered by its pixels."""
    index = np.stack([rises.top, rises.foot])
    row, column = np.divmod(index, columns) - np.array([[[p.start]] for p in window], np.int32)
    height, width = (part.stop - part.start for part in window)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    if mask is not None:
        inside &= mask.ravel()[index] != 0
    is_inside = inside.all(axis=0)
    top, foot = (row * width + column).compress(is_inside, axis=1)
    return top, foot, rises.rise[is_inside]


def _constants(
    window: Window, anchored: bool, floor: float, rise_px: float, robust: float, pixel: float
) -> tuple[I4, NDArray[np.uint8], NDArray[np.float64]]:
    """The last fields of `HeightSystem`: the window's corner, its film at rest, the scales."""
    corner = np.array([window.rows.start, window.columns.start], np.int32)
    scales = np.array([floor * pixel, rise_px * pixel, robust, pixel])
    return corner, np.array([anchored], np.uint8), scales


@height_system.opencl()
def _launch(run: Launch) -> None:
    """Gather the pixels on the device, while the host finds the rises inside the window."""
    rows, columns = run.sizes["H"], run.sizes["W"]
    inputs, settings = run.inputs, run.settings
    rest, mask, pixel = inputs["rest"], inputs.get("mask"), float(inputs["pixel"])
    stated = (inputs.get(f"rises.{name}") for name in ("top", "foot", "rise"))
    coming = [run.begin_download(part) for part in stated if part is not None]
    coming_mask = None if mask is None else run.begin_download(mask)
    rest_here = run.begin_download(rest)()
    mask_here = None if coming_mask is None else coming_mask()
    _, window, anchored = _touched_window(rest_here, mask_here)
    (top, height), (left, width) = ((part.start, part.stop - part.start) for part in window)
    run.set_size("h", height)
    run.set_size("w", width)
    run.kernel(
        "gather_system", run.in_row_lanes(height, width),
        inputs["slope"], inputs["variance"], rest, mask,
        *(run.outputs[name] for name in HeightSystem._fields[:5]),
        rows * columns, columns, top, left, height, width,
        pixel, settings["bend"], float(np.float32(settings["floor"] ** 2)),
    )  # fmt: skip
    rises = ShadowRises.none()
    if coming:
        tops, feet, rise = (arrived() for arrived in coming)
        rises = ShadowRises(tops, feet, rise, rises.led)
    ends = _rises_inside(window, rises, columns, mask_here)
    run.set_size("T", ends[0].size)
    limits = settings["floor"], settings["rise_px"], settings["robust"]
    arguments: list[NDArray[Any]] = [*ends, *_constants(window, anchored, *limits, pixel)]
    for name, array in zip(HeightSystem._fields[5:], arguments, strict=True):
        if array.size:
            run.send(array, run.outputs[name])


@height_system.example
def _example(rng: np.random.Generator, **sizes: int) -> dict[str, Any]:
    """Rises with both ends in the frame, some unknown slopes, and film at rest outside.

    Sometimes no film is at rest.  Then all pixels count, because a part without any constraint
    could have any height.
    """
    rows, columns = sizes["H"], sizes["W"]
    number = rows * columns // 7
    rest = np.ones((rows, columns), np.uint8)
    rest[1 + rows // 8 : rows - rows // 5, columns // 6 : columns - columns // 8] = 0
    mask = (rng.random((rows, columns)) < 0.95).astype(np.uint8)
    if rng.random() < 0.2:
        rest[:], mask[:] = 0, 1
    variance = rng.uniform(1e-6, 1e-2, (2, rows, columns)).astype(np.float32)
    variance[:, rng.random((rows, columns)) < 0.1] = 1e12
    ends = rng.integers(0, rows * columns, (2, number)).astype(np.int32)
    return {
        "rest": rest,
        "variance": variance,
        "rises.top": ends[0],
        "rises.foot": ends[1],
        "rises.rise": rng.uniform(-0.2, 1, number).astype(np.float32),
        "rises.led": rng.integers(1, 5, number).astype(np.uint8),
        "mask": mask,
    }


def example_system(rng: np.random.Generator, slope: Slope, **sizes: int) -> dict[str, Any]:
    """The equations of such a film, as another node's input `system`."""
    inputs = {"pixel": float(rng.uniform(0.01, 0.2)), **_example(rng, **sizes), "slope": slope}
    system = height_system(*height_system.in_order(inputs), robust=rng.choice([2.5, 25.0]))
    return {f"system.{name}": value for name, value in system._asdict().items()}
