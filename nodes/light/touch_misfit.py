"""Compare the model error of a touch with that of the calibration's presses.

Long because noise, brightness and the error common to all normals are separated, and because film
at rest shows errors that touched film cannot.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node, warn
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import (
    F4,
    FULL_MISFIT_SLOPE,
    Height,
    Labels,
    Light,
    LightPositions,
    Mask,
    Misfit,
    PixelSize,
    Slope,
    Uneven,
)
from tactograph.nodes.optics.block_sums import block_sums
from tactograph.nodes.optics.film import LIGHT_NOISE_SHARE
from tactograph.nodes.optics.near_light import (
    brightness_share,
    expected_light,
    image_places,
    light_vectors,
    matt_film_light,
    vectors_at,
)

MIN_LAG_PX = 2
"""Distance from which on the noise of two pixels is independent."""
BLOCK_PX = 16
"""Side in pixels of the blocks whose median counts: dirt or an edge in some is no model error."""
MEDIAN_ERROR = 1.86
"""Standard error of the median of n normal values, times sqrt(n), over their median absolute
deviation."""
MIN_SHARE, MAX_SHARE = 0.5, 1.5
"""Limits on a normal's error per residual of the light; on presses either may be pure noise."""
MIN_COMMON_SHARE = 0.3
"""Smallest share of an additional error that is common to all normals of a touch; on presses it is
0.25 to 0.65 for simulated sensors, and 1 for a real one."""
WARN_MISFIT_RATIO, MIN_WARN_MISFIT = 2.0, 0.005
"""Multiple of the calibration's residual, and light, above which a residual gives a warning."""


@node(
    tolerance=Close(1e-6, 1e-3, why="sums over LEDs and blocks in another order"),
    sizes={"K": SizeLimit(1, 8, "a label holds a bit for each of at most 8 LEDs")},
)
def touch_misfit(
    light: Light,
    slope: Slope,
    height: Height,
    used: Labels,
    lights: LightPositions,
    misfit: Misfit,
    pixel: PixelSize,
    uneven: Uneven,
    rest: Mask,
    tilt: Slope | None = None,
) -> Misfit:
    """Increase the model's misfit if a touch departs from it more than the calibration's presses.

    With more than three LEDs the light over-determines normal and brightness.  The residual that
    neighbouring pixels share is model error; its median over blocks is used.  The error of the
    normals is proportional to it, by the ratio found on the presses.  The part that exceeds the
    residual of the presses is added to their misfit in quadrature; the same share of it as on
    the presses is a tilt common to all normals.

    Film at rest shows errors that a normal cannot absorb: a drift of the LEDs since the flat frame
    that `film_drift` does not find, and light from the touch that the model does not contain.  The
    part that neighbouring blocks share is also an error of each LED's light on the touch.

    Parameters
    ----------
    light : K x H x W, of a matt film (`matt_light`)
    slope, used : 2 x H x W and H x W, from `label_lights`
    height : H x W in mm, as given to `label_lights`; on the film at rest, its own height
    lights : K x 3 in mm
    misfit : length 5, the calibration's misfit
    pixel : mm per px
    uneven : standard deviation of the film's brightness, as given to `label_lights`
    rest : H x W, 1 on the film at rest
    tilt : 2 x H x W, slopes of the film at rest; None: a plane

    Returns
    -------
    The misfit of this touch; its `light` is the departure of the film at rest.  A clearly larger
    departure than the presses' gives a warning.
    """
    (p, q), lag = slope, _lag(misfit, pixel)
    steep = p * p + q * q > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE
    counts = (used == (1 << len(lights)) - 1) & steep
    # Only the blocks around steep film that all LEDs reach.
    rows, columns = part = tuple(_reach(counts.any(axis=axis), lag) for axis in (1, 0))
    counts, (x, y) = counts[part], image_places(height.shape, pixel)
    vectors = vectors_at(lights, x[:, columns], y[rows], height[part])
    model_light = expected_light(vectors, slope[:, rows, columns])
    departs = light[:, rows, columns] - model_light
    departs -= brighter(departs, model_light, uneven) * model_light
    product: F4 | np.float32 = np.float32(0)
    for plane in departs:
        steep_part = np.where(counts, plane, np.float32(0))
        beside = steep_part[lag:, :-lag] + steep_part[:-lag, lag:]
        product = product + steep_part[:-lag, :-lag] * beside
    pairs = counts[:-lag, :-lag] * (counts[lag:, :-lag].astype(np.float32) + counts[:-lag, lag:])
    mean = np.asarray(product / np.float32(len(lights)), np.float32)
    residual = _typical(block_sums(mean, BLOCK_PX), block_sums(pairs, BLOCK_PX))
    # The departure of the film at rest, by LED and block.
    level = np.zeros((2, *height.shape), np.float32) if tilt is None else tilt
    calm = (rest != 0).astype(np.float32)
    planes = (light - matt_film_light(lights, height, level, pixel)) * calm
    total = np.stack([block_sums(plane, BLOCK_PX) for plane in planes])
    return _widened(misfit, residual, _shared(total, block_sums(calm, BLOCK_PX)))


def _widened(misfit: Misfit, residual: float, departs: float) -> Misfit:
    """The misfit of a touch, from the residual on its flanks and the departure of film at rest."""
    level, width, pressed, bounce, tilt = (float(v) for v in misfit)
    if residual <= pressed:
        return np.asarray([level, width, departs, bounce, tilt], np.float32)
    share = min(max(level / pressed, MIN_SHARE), MAX_SHARE) if pressed > 0 else MIN_SHARE
    beyond = share**2 * (residual**2 - pressed**2)
    common = min(max(tilt / level, MIN_COMMON_SHARE), 1.0) if level > 0 else 1.0
    tilt, wider = float(np.hypot(tilt, common * np.sqrt(beyond))), float(np.sqrt(level**2 + beyond))
    if residual > WARN_MISFIT_RATIO * pressed and residual > MIN_WARN_MISFIT:
        times = wider / max(level, pressed)
        warn(
            f"the light departs from the film's model by {100 * residual:.1f} %, on the "
            f"calibration's presses by {100 * pressed:.1f} %: the model's part of the stated "
            f"error is {times:.1f} times as large"
        )
    return np.asarray([wider, width, departs, bounce, tilt], np.float32)


def _typical(total: F4, counts: F4) -> float:
    """The root mean square of the residual that neighbours share, in the median block.

    Noise gives products of either sign; only the median in excess of its standard error counts.
    """
    plenty = counts > BLOCK_PX * BLOCK_PX
    if not plenty.any():
        return 0.0
    product = total[plenty] / counts[plenty]
    middle = np.median(product)
    error = MEDIAN_ERROR * np.median(np.abs(product - middle)) / np.sqrt(product.size)
    return float(np.sqrt(max(middle - error, 0)))


def _shared(total: F4, counted: F4) -> float:
    """The root mean square of the departure that neighbouring blocks of film at rest share."""
    plenty, mean = counted > BLOCK_PX * BLOCK_PX / 2, total / np.maximum(counted, np.float32(1))
    across = (mean[:, :, 1:] * mean[:, :, :-1])[:, plenty[:, 1:] & plenty[:, :-1]]
    down = (mean[:, 1:] * mean[:, :-1])[:, plenty[1:] & plenty[:-1]]
    products = np.concatenate([across, down], axis=1)
    return float(np.sqrt(max(products.mean(), 0))) if products.size else 0.0


def _lag(misfit: Misfit, pixel: float) -> int:
    """The distance in pixels of the pixels that are compared."""
    return max(MIN_LAG_PX, round(float(misfit[1]) / pixel / 4))


def brighter(departs: F4, model_light: F4, uneven: float) -> F4:
    """Return by which share film is brighter than predicted, from the residuals of the light."""
    noise = np.float32(LIGHT_NOISE_SHARE * LIGHT_NOISE_SHARE)
    share = brightness_share((model_light * model_light).sum(axis=0), noise, np.float32(uneven))
    return np.asarray((departs * model_light).sum(axis=0) * share)


def _reach(counts: NDArray[np.bool_], lag: int) -> slice:
    """The span of blocks around all that count, plus `lag`; the first block if none counts."""
    indices = np.flatnonzero(counts)
    first, last = (int(indices[0]), int(indices[-1])) if indices.size else (0, 0)
    return slice(first // BLOCK_PX * BLOCK_PX, (last // BLOCK_PX + 1) * BLOCK_PX + lag)


@touch_misfit.opencl()
def _launch(run: Launch) -> None:
    """Sum over blocks on the device; find the median on the host."""
    inputs, pixel = run.inputs, run.inputs["pixel"]
    count, height, width = (run.sizes[symbol] for symbol in "KHW")
    misfit = run.download(inputs["misfit"])
    lag = _lag(misfit, pixel)
    misfits, counts = run.scratch((count, height, width)), run.scratch((height, width))
    run.kernel(
        "leave", run.in_lanes(height, width),
        *(inputs[name] for name in ("light", "slope", "height", "used", "lights")),
        misfits, counts, count, height, width, pixel, inputs["uneven"],
    )  # fmt: skip
    rows, columns = blocks = tuple(max(side - lag, 0) // BLOCK_PX for side in (height, width))
    total, block_counts = run.scratch(blocks), run.scratch(blocks)
    if rows * columns:
        run.kernel(
            "add_blocks", blocks,
            misfits, counts, total, block_counts, count, height, width, lag, rows, columns,
        )  # fmt: skip
    blocks = height // BLOCK_PX, width // BLOCK_PX
    departing, calm = run.scratch((count, *blocks)), run.scratch(blocks)
    if math.prod(blocks):
        run.kernel(
            "rest_blocks", (count, *blocks),
            *(inputs[name] for name in ("light", "height", "lights", "rest")), inputs.get("tilt"),
            departing, calm, count, height, width, pixel, *blocks,
        )  # fmt: skip
    residual = _typical(run.download(total), run.download(block_counts))
    widened = _widened(misfit, residual, _shared(run.download(departing), run.download(calm)))
    run.send(widened, run.outputs["touch_misfit"])


@touch_misfit.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around a film that reach all but some pixels; the light departs in patches."""
    around = rng.uniform(0, 2 * np.pi, K)
    lights = np.stack([20 * np.cos(around), 20 * np.sin(around), 0 * around + 8], axis=1)
    slope = rng.uniform(-0.5, 0.5, (2, H, W)).astype(np.float32)
    height = rng.uniform(0, 0.1, (H, W)).astype(np.float32)
    vectors = light_vectors(lights.astype(np.float32), height, 0.05)
    turn = np.arange(K)[:, None, None]
    down, across = np.arange(H)[:, None] / 11, np.arange(W) / 17
    departs = np.sin(down + turn) * np.sin(across + 1 + 2 * turn)
    light = expected_light(vectors, slope) * (1 + 0.1 * departs)
    noisy = light + rng.normal(0, 0.01, light.shape)
    geometry = {"slope": slope, "height": height, "lights": lights, "pixel": 0.05}
    return {
        **geometry,
        "light": noisy,
        "used": np.where(rng.random((H, W)) < 0.1, 1, (1 << K) - 1),
        "uneven": 0.03,
        "rest": np.arange(H)[:, None] + np.arange(W) > (H + W) / 2,
        "tilt": rng.normal(0, 0.2, (2, H, W)),
        "misfit": [0.003, 1, 0.002, 0.05, 0.002],
    }
