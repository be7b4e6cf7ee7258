"""Find the drift of each LED's light since the flat frame, from the film at rest.

Long because calm cells and drift are found in turn, on the host and in launches on the device.
"""

from functools import lru_cache
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import F4, FALSE_ALARMS, Grain, Light, LightPositions
from tactograph.nodes.light.border import border_level
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.optics.film import place_terms
from tactograph.nodes.optics.near_light import image_places

DRIFT_TERMS, TERMS_BY_DEGREE, FIT_SUMS = 6, (1, 3, 6), 22 + 8 * 7
"""Number of terms 1, u, v, u^2, u v, v^2; how many a degree needs; number of the kernels' sums."""
MIN_GAIN = np.float32(0.02)
FILM_ROUGHNESS = 0.01
"""Departure beyond noise that counts as calm where the film's grain is not known."""
CALM_DEPARTURES = (0.03, 0.01, 0.0)
"""Departure beyond noise that still counts as calm, by round."""
MIN_CALM_SHARE = 0.05
"""Smallest share of calm cells; film that is touched everywhere shows no drift."""
MAX_CELLS = 8000
"""Largest number of cells; more add no information, and are averaged four into one."""
COARSE_GRAIN_SHARE = 0.5
"""Share of the film's grain that is coarser than a cell."""
WINDOW_CELLS = 5
"""Side in cells of the window around a cell, whose mean has 1 / WINDOW_CELLS of a cell's noise."""
TOUCH_DEPARTURE = 0.003
"""Departure of a window's mean, beyond noise, that shows a touch."""
SKIRT_CELLS = 5
"""Distance from a touch, in cells, within which cells count less, by its square."""
SLOPE_COMPONENTS = 2
"""Number of patterns, of K over the LEDs, in which a slope changes the light: one each by x, y."""
SHAPE_REGULARISATION = 0.003
"""Regularisation of the drift's shape, as a share of all cells; it matters if few are calm."""

Drift = Annotated[F4, Port("K 6", "1")]
"""Per LED the coefficients of 1, u, v, u^2, u v, v^2 of its light over that of the flat frame;
u and v are x and y from the middle of the image, divided by half its width."""


@node(
    tolerance=Close(1e-3, why="a cell on the threshold of calm"),
    sizes={"K": SizeLimit(1, 8, "more LEDs than a label has bits")},
)
def film_drift(
    light: Light,
    sigma: Light | None = None,
    before: Drift | None = None,
    grain: Grain | None = None,
    bounced: Light | None = None,
    thrown: Light | None = None,
    share: Light | None = None,
    lights: LightPositions | None = None,
    *,
    degree: Annotated[int, Interval(ge=0, le=2)] = 0,
    rate: Annotated[float, Interval(ge=0, le=1)] = 1.0,
    level: Annotated[float, Ge(0)] = 4.5,
    factor: Annotated[int, Interval(ge=1, le=64)] = 4,
    flat_noise: Annotated[float, Ge(0)] = 1.0,
) -> Drift:
    """Return each LED's light on the film at rest as a polynomial in x and y; 1 is no drift.

    Light divided by the flat frame is 1 on the film at rest, until an LED fades or warms up,
    or the sensor is bent.  A cell is calm (at rest) if the light of all LEDs, divided by the
    drift, is 1 within the film's roughness plus `level` standard deviations.  Three rounds of
    least squares fit the drift to the calm cells; the first round also accepts departures of 3 %.
    They start from the previous drift, or from that drift scaled to the medians of the frame's
    border if this makes more cells calm.  A single cell on the skirt of a touch looks
    like film at rest.  So the last round also requires the mean of 5 x 5 cells to be calm, and
    reduces the weight within five cells of a cell whose mean departs by a further 0.3 %.  If
    less than a twentieth of the frame remains, cells that are calm alone count.

    The level (the term 1) follows at once, because LEDs flicker.  The shape (all other terms)
    follows by `rate`, and is regularised where a touch hides it.  A slope of the film, as on the
    wide skirt of a touch, changes the light of K LEDs in two patterns only, while LEDs drift
    independently.  So if the LEDs' places are known, the mean square of the shape in these two
    patterns is compared with that in the other K - 2, which drift alone makes.  If it is larger
    than by chance (an F test at `FALSE_ALARMS`), the shape counts as drift by the inverse of their
    ratio.  An LED keeps its previous drift if the change explains no more than noise would (`level`
    standard deviations of the touch and the flat frame together).  Cells that are calm alone may
    all lie on a skirt, where they depart alike: there the share of the change that is drift (of its
    level without a test, which has too few values for one) must explain more than what a single
    calm cell may depart by.  All LEDs keep it if less than a twentieth of the frame is calm.

    Parameters
    ----------
    light, sigma
        K x H x W on the cells of `coarsen`: light relative to the film at rest, and the standard
        deviation of a single pixel (None: 0).
    before : K x 6, the drift of the previous item; None: 1 everywhere
    grain
        The film's grain; half of it is the roughness, because texture is wider than a cell.  None:
        it is not known, and `FILM_ROUGHNESS` counts.
    bounced
        K x H x W, the light from film to film (`film_bounce`).  It is subtracted, since light that
        a touch throws on the film at rest is no drift.
    thrown, share
        K x H x W, the light from film to film of the film at rest, and r, from `untouched_film`;
        needed if the film at rest is not a plane, since `bounced` is relative to a plane.
    lights
        K x 3, the LEDs in mm.  None: all of the shape counts as drift.
    degree : 0: a factor for each LED; 1 or 2: a polynomial in x and y
    rate : share of a change of shape that is applied at once
    level : standard deviations that still count as noise
    factor : side of a cell in pixels; its light has 1 / factor of a pixel's noise
    flat_noise
        Noise of the flat frame relative to a touch's: 1 for a single frame, 1 / sqrt(n) for
        the mean of n.

    Returns
    -------
    K x 6, the coefficients of 1, u, v, u^2, u v, v^2, where u and v are x and y from the middle of
    the image, divided by half its width.
    """
    if bounced is not None and thrown is not None and share is not None:
        bounced = (bounced - thrown) / share
    if bounced is not None:
        light = light - bounced
    while light[0].size > MAX_CELLS:
        light = coarsen(light, factor=2)
        sigma = None if sigma is None else coarsen(sigma, factor=2)
        factor *= 2
    count, rows, columns = light.shape
    basis = _basis(rows, columns)
    cells, around = light.reshape(count, -1), _around(light).reshape(count, -1)
    noise_share = np.float32(level) / np.float32(factor)
    noise = np.zeros_like(cells) if sigma is None else noise_share * sigma.reshape(count, -1)
    if before is None:
        before = np.zeros((count, DRIFT_TERMS), np.float32)
        before[:, 0] = 1
    lit = np.asarray(cells / np.maximum(_gain(before, basis), MIN_GAIN), np.float32)
    other = before * border_level(lit.reshape(light.shape))[:, None]
    roughness = _roughness(grain)
    widest = np.float32(roughness + CALM_DEPARTURES[0])
    better = _calm(cells, noise, basis, other, widest).sum()
    drift = other if better > _calm(cells, noise, basis, before, widest).sum() else before
    used = TERMS_BY_DEGREE[degree]
    for beyond in CALM_DEPARTURES:
        is_last = beyond == CALM_DEPARTURES[-1]
        weight = calm = _calm(cells, noise, basis, drift, np.float32(roughness + beyond))
        if calm.mean() < MIN_CALM_SHARE:
            return before
        if is_last:
            less = noise * np.float32(1 / WINDOW_CELLS)
            clear = calm * _calm(around, less, basis, drift, np.float32(roughness))
            still = _calm(around, less, basis, drift, np.float32(roughness + TOUCH_DEPARTURE))
            if clear.mean() >= MIN_CALM_SHARE:
                weight = _beside_skirt(clear, still.reshape(rows, columns))
        follow = rate if is_last else 1.0
        drift, explained, drifted = _fit(cells, weight, basis, before, used, lights, follow)
    chance = np.square(noise) @ weight / weight.sum()
    if weight is calm:
        chance = (chance + np.float32(roughness * roughness)) * calm.sum()
        explained = drifted
    return np.where((explained > chance * (1 + flat_noise**2))[:, None], drift, before)


def _roughness(grain: Any) -> float:
    return FILM_ROUGHNESS if grain is None else COARSE_GRAIN_SHARE * float(grain)


def terms(size: tuple[int, ...]) -> F4:
    """Return 1, u, v, u^2, u v, v^2 at the pixels of an image: 6 x H x W."""
    return place_terms(*np.broadcast_arrays(*image_places(size, 2 / size[1])))


def drift_gain(drift: Drift, size: tuple[int, ...]) -> F4:
    """Return the factor on each LED's light: K x H x W, or K x 1 x 1 if the drift is uniform."""
    c = drift[:, :, None, None]
    if not drift[:, 1:].any():
        return np.maximum(c[:, 0], MIN_GAIN)
    u, v = image_places(size, 2 / size[1])
    gain = c[:, 0] + c[:, 1] * u + c[:, 2] * v
    gain = gain + c[:, 3] * u * u + c[:, 4] * u * v + c[:, 5] * v * v
    return np.asarray(np.maximum(gain, MIN_GAIN), np.float32)


@lru_cache(maxsize=4)
def _basis(rows: int, columns: int) -> F4:
    """The six terms at each of N cells, 6 x N."""
    basis = terms((rows, columns)).reshape(DRIFT_TERMS, -1)
    basis.flags.writeable = False
    return basis


def _gain(drift: F4, basis: F4) -> F4:
    """The drift at each cell, K x N; K x 1 if it is uniform, as nearly always."""
    return np.asarray(drift @ basis if drift[:, 1:].any() else drift[:, :1], np.float32)


def _around(light: F4) -> F4:
    """The mean over the window around each cell; the border repeats beyond the frame."""
    window = (WINDOW_CELLS, WINDOW_CELLS)
    planes = [cv2.blur(plane, window, borderType=cv2.BORDER_REPLICATE) for plane in light]
    return np.asarray(planes, np.float32)


def _calm(light: F4, noise: F4, basis: F4, drift: F4, beyond: np.float32) -> F4:
    """1 for each of N cells whose light agrees with the drift, else 0."""
    gain = _gain(drift, basis)
    away = light - gain
    np.abs(away, out=away)
    most = noise + beyond
    most *= gain
    return np.asarray((away < most).all(axis=0), np.float32)


def _beside_skirt(clear: F4, still: F4) -> F4:
    """The weight of each of N clear cells, at most 1, by its distance to the nearest touch."""
    away = cv2.distanceTransform(still.astype(np.uint8), cv2.DIST_C, 3).ravel()
    far = clear * np.minimum(away, SKIRT_CELLS + 1)
    return np.asarray(np.square(far / far.max()), np.float32)


def _fit(
    light: F4, weight: F4, basis: F4, before: F4, used: int, lights: F4 | None, rate: float
) -> tuple[F4, F4, F4]:
    """Fit by weighted least squares over the cells; regularise the shape towards `before`.

    Returns the drift, for each LED the sum of squares that its change explains, and how much of it
    is drift.
    """
    weighted = basis[:used] * weight
    product = weighted @ (light - _gain(before, basis)).T
    held = weight.sum() / max(np.count_nonzero(weight), 1)
    ridge = np.full(used, SHAPE_REGULARISATION * held * weight.size, np.float32)
    ridge[0] = 0
    gram = np.asarray(weighted @ basis[:used].T, np.float32)
    change = np.linalg.solve(gram + np.diag(ridge), product)
    explained = (change * product).sum(axis=0)
    mean, centred = product[0] / gram[0, 0], np.outer(gram[0, 1:], gram[0, 1:]) / gram[0, 0]
    level = mean * product[0]
    of_level = _drift_share(mean[None], np.ones((1, 1), np.float32), lights, test=False)
    of_shape = _drift_share(change[1:], gram[1:, 1:] - centred, lights, test=True)
    change[1:] *= of_shape * np.float32(rate)
    change[0] = mean - gram[0, 1:] @ change[1:] / gram[0, 0]
    drift = before.copy()
    drift[:, :used] += change.T
    return drift, explained, of_level * level + of_shape * (explained - level)


def _drift_share(change: F4, spread: F4, lights: F4 | None, *, test: bool) -> np.float32:
    """The share of a change, terms x K of products `spread`, that is drift and no slope.

    Both add to the mean square in the patterns of slopes, drift alone to that in the others.  With
    a test, all is drift unless its patterns differ by more than chance.
    """
    terms, leds = change.shape
    others = leds - SLOPE_COMPONENTS
    if lights is None or others < 1:
        return np.float32(1)
    patterns = np.linalg.qr(lights[:, :2] / lights[:, 2:])[0]
    total, sloped = (float((c * (spread @ c)).sum()) for c in (change, change @ patterns))
    rest = max(total - sloped, 0.0)
    if not total or (test and _chance(rest / total, terms, others) > FALSE_ALARMS):
        return np.float32(1)
    return np.float32(min(1.0, SLOPE_COMPONENTS * rest / (others * sloped)) if sloped else 1)


def _chance(rest: float, terms: int, others: int) -> float:
    """The chance that drift alone has no more than a share `rest` of squares in the other patterns.

    That is the F distribution of 2 `terms` and `others` x `terms` values, as a finite sum.
    """
    values = terms * others / 2
    chance, part = 0.0, rest**values
    for number in range(terms):
        chance += part
        part *= (values + number) / (number + 1) * (1 - rest)
    return chance


@film_drift.opencl()
def _launch(run: Launch) -> None:
    """Average around the cells, choose a start, then weight and fit three times in one group."""
    light, out = run.inputs["light"], run.outputs["film_drift"]
    sigma, before = run.inputs.get("sigma"), run.inputs.get("before")
    lights, height, width = (run.sizes[name] for name in "KHW")
    bounced, factor = run.inputs.get("bounced"), int(run.settings["factor"])
    if bounced is not None:
        everything, direct = lights * height * width, run.scratch((lights, height, width))
        work = run.in_lanes(lights, height, width)
        at_rest = run.inputs.get("thrown"), run.inputs.get("share")
        run.kernel("take_off", work, light, bounced, *at_rest, direct, everything)
        light = direct
    noisy = light if sigma is None else sigma
    while height * width > MAX_CELLS:
        light, noisy = (_launch_halved(run, plane, height, width) for plane in (light, noisy))
        height, width, factor = (height + 1) // 2, (width + 1) // 2, 2 * factor
    sizes, group = (lights, height, width), (run.group,)
    share = 0.0 if sigma is None else float(run.settings["level"]) / factor
    used, roughness = TERMS_BY_DEGREE[run.settings["degree"]], _roughness(run.inputs.get("grain"))
    rate, doubt = float(run.settings["rate"]), 1 + float(run.settings["flat_noise"]) ** 2
    around, ring = run.scratch(sizes), run.scratch((height * width,))
    old, drift, spare = (run.scratch((lights, DRIFT_TERMS)) for _ in range(3))
    shares, counts = run.scratch((FIT_SUMS, run.group)), run.scratch((3,), np.int32)
    clear, still, weights = (run.scratch((height, width)) for _ in range(3))
    cells, rows = run.in_lanes(height, width), run.in_row_lanes(height, width)

    def fit(drift: DeviceArray, *follow: float) -> None:
        planes = light, noisy, weights, old, run.inputs.get("lights"), drift, shares, counts
        run.kernel("fit", group, *planes, *sizes, used, share, *follow, local=group)

    run.kernel("look_around", run.in_row_lanes(*sizes), light, around, *sizes)
    start = light, noisy, out if before is None else before, ring, old, drift, counts
    begin = int(before is not None), share, roughness + CALM_DEPARTURES[0]
    run.kernel("begin", group, *start, *sizes, *begin, local=group)
    for beyond in CALM_DEPARTURES[:-1]:
        calm = light, noisy, drift, weights
        run.kernel("weigh_calm", cells, *calm, *sizes, share, roughness + beyond)
        fit(spare, 1.0, 0.0, 0.0)
        drift, spare = spare, drift
    judged = light, around, noisy, drift, clear, still, counts
    run.kernel("find_clear", cells, *judged, *sizes, share, roughness + CALM_DEPARTURES[-1])
    run.kernel("weigh_clear", rows, clear, still, counts, weights, height, width)
    fit(out, rate, doubt, roughness * roughness)


def _launch_halved(run: Launch, light: DeviceArray, height: int, width: int) -> DeviceArray:
    shape = (run.sizes["K"], (height + 1) // 2, (width + 1) // 2)
    halved = run.scratch(shape)
    run.kernel("halve", run.in_row_lanes(*shape), light, halved, *shape, height, width)
    return halved


@film_drift.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A film whose LEDs have drifted, with a touch in a quarter of it; perhaps skirts all over."""
    before = np.zeros((K, DRIFT_TERMS))
    before[:, 0] = rng.uniform(0.95, 1.05, K)
    before[:, 1:] = rng.uniform(-0.02, 0.02, (K, DRIFT_TERMS - 1))
    drift = before + rng.uniform(-0.01, 0.01, (K, DRIFT_TERMS))
    light = np.tensordot(drift, terms((H, W)), axes=1)
    light += rng.normal(0, 0.002, light.shape)
    bounced = rng.uniform(0, 0.03, light.shape)
    light += 0.7 * bounced
    light[:, : H // 2, : W // 2] *= rng.uniform(0.3, 1.5, (K, H // 2, W // 2))
    sigma = np.full((K, H, W), 0.002)
    if rng.random() < 0.5:
        sigma *= 10
        light += np.float32(0.015) * np.sin(np.arange(W) / 3)
    share = rng.uniform(0.8, 1.3, light.shape)
    lights = np.stack([*rng.uniform(-30, 30, (2, K)), rng.uniform(20, 40, K)], axis=1)
    inputs = {"light": light, "sigma": sigma, "before": before, "share": share, "lights": lights}
    return {**inputs, "bounced": bounced, "thrown": 0.3 * bounced}
