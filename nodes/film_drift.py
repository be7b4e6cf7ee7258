"""How each LED's light has drifted since the flat frame, as the film at rest shows it."""

from __future__ import annotations

from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge, Interval
from numpy.typing import NDArray

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Light

GROUP, WORKERS, SUMS = 64, 256, 21 + 8 * 7
"""Of the kernels: work-items that share a median, that share the sums, and sums of each."""
TERMS, TERMS_OF = 6, (1, 3, 6)
"""1, u, v, u^2, u v, v^2; and how many of them each degree has."""
STEP, REACH = 4, 2
"""Light is looked at every so many px, as the mean over so many px to each side."""
DARKEST = np.float32(0.02)
SEARCH = (0.03, 0.01, 0.0)
"""Departures that count as calm in round after round, beyond the noise."""
FEWEST = 0.05
"""Share of the places that must be calm; a film that is all touch tells nothing."""
HELD = 0.003
"""How firmly the drift's shape is held where there is little calm film: a share of all places."""

Drift = Annotated[F4, Port("K 6", "1")]
"""Per LED the coefficients of 1, u, v, u^2, u v, v^2 of its light over that of the flat frame;
u and v are x and y from the middle of the image, divided by half its width."""


@node(
    tolerance=Close(1e-3, why="a place on the threshold of calm"),
    sizes={"K": SizeLimit(1, 8, "more LEDs than a label has bits")},
)
def film_drift(
    light: Light,
    sigma: Light | None = None,
    before: Drift | None = None,
    *,
    degree: Annotated[int, Interval(ge=0, le=2)] = 0,
    rate: Annotated[float, Interval(ge=0, le=1)] = 1.0,
    level: Annotated[float, Ge(0)] = 4.5,
    rough: Annotated[float, Interval(ge=0, le=0.1)] = 0.0,
) -> Drift:
    """Return by what polynomial each LED's light on the film at rest departs from 1.

    Light divided by the flat frame is 1 on the film at rest, until an LED fades, warms up
    or the sensor is bent.  The film is at rest where the light of all LEDs is 1 within
    `rough` and `level` standard deviations of a mean over 5 x 5 px, once the drift found is
    taken out: three rounds of least squares on every fourth pixel, the first of which takes
    what departs by 3 % too.  It starts from the drift before, or from the medians of the
    frame's border if more of the film is calm under those.

    Of the level, what is found counts at once: LEDs flicker.  The shape follows slowly, by
    `rate`, and is held where a touch hides it.  The drift before stays where a change
    explains no more than chance would (`level` standard deviations), and without calm film
    on a twentieth of the frame.

    Parameters
    ----------
    light
        K x H x W, relative to the film at rest.
    sigma
        K x H x W, its standard deviation; none: 0.
    before
        K x 6, the drift of the item before; none: 1 everywhere.
    degree
        0: a factor per LED; 1 or 2: a polynomial in x and y.
    rate
        Share of a change of shape that is followed at once.
    level
        Standard deviations of a mean that still count as noise.
    rough
        Departure that still counts as calm, beyond noise.

    Returns
    -------
    ndarray
        K x 6: coefficients of 1, u, v, u^2, u v, v^2, u and v being x and y from the
        middle of the image divided by half its width.
    """
    means, noise, basis = _places(light, sigma, level)
    if before is None:
        before = np.zeros((len(light), TERMS), np.float32)
        before[:, 0] = 1
    drift = _start(means, noise, basis, before, np.float32(rough + SEARCH[0]))
    count = TERMS_OF[degree]
    for beyond in SEARCH:
        calm = _calm(means, noise, basis, drift, np.float32(rough + beyond))
        if calm.mean() < FEWEST:
            return before
        drift, explained = _fit(means, calm, basis, before, count)
    drift[:, 1:count] = before[:, 1:count] + np.float32(rate) * (drift - before)[:, 1:count]
    left = (means - np.tensordot(drift, basis, axes=1))[:, calm]
    drift[:, 0] += left.mean(axis=1)
    chance = np.square(noise[:, calm]).mean(axis=1)
    return np.where((explained > chance)[:, None], drift, before)


def _places(light: F4, sigma: F4 | None, level: float) -> tuple[F4, F4, F4]:
    """Mean light and its noise K x R x C on every fourth pixel, and the terms there."""
    rows, columns = (np.minimum(np.arange(REACH, n + REACH, STEP), n - 1) for n in light.shape[1:])
    size = (2 * REACH + 1, 2 * REACH + 1)
    blurred = [cv2.blur(plane, size, borderType=cv2.BORDER_REPLICATE) for plane in light]
    means = np.stack([plane[np.ix_(rows, columns)] for plane in blurred])
    share = np.float32(level) / np.float32(2 * REACH + 1)
    noise = np.zeros_like(means) if sigma is None else share * sigma[:, rows[:, None], columns]
    return means, np.asarray(noise, np.float32), terms(rows, columns, light.shape[1:])


def terms(rows: NDArray[np.intp], columns: NDArray[np.intp], size: tuple[int, ...]) -> F4:
    """Return 1, u, v, u^2, u v, v^2 at the rows and columns of an image: 6 x R x C."""
    height, width = size
    scale = np.float32(2 / width)
    u = (columns.astype(np.float32) - np.float32(0.5 * (width - 1)))[None, :] * scale
    v = (rows.astype(np.float32) - np.float32(0.5 * (height - 1)))[:, None] * scale
    one, u, v = np.ones_like(u * v), u + 0 * v, v + 0 * u
    return np.stack([one, u, v, u * u, u * v, v * v])


def _calm(means: F4, noise: F4, basis: F4, drift: F4, beyond: np.float32) -> NDArray[np.bool_]:
    gain = np.tensordot(drift, basis, axes=1)
    return np.asarray((np.abs(means - gain) < gain * (noise + beyond)).all(axis=0))


def _start(means: F4, noise: F4, basis: F4, before: F4, beyond: np.float32) -> F4:
    """The drift before, or with the level of the border, whichever leaves more film calm."""
    ratio = means / np.maximum(np.tensordot(before, basis, axes=1), DARKEST)
    ring = (ratio[:, 0], ratio[:, -1], ratio[:, 1:-1, 0], ratio[:, 1:-1, -1])
    thin = min(ratio.shape[1:]) <= 2
    border = ratio.reshape(len(ratio), -1) if thin else np.concatenate(ring, axis=1)
    middle = (border.shape[1] - 1) // 2
    other = before * np.partition(border, middle, axis=1)[:, middle, None]
    better = _calm(means, noise, basis, other, beyond).sum()
    kept = _calm(means, noise, basis, before, beyond).sum()
    return np.asarray(other if better > kept else before, np.float32)


def _fit(means: F4, calm: NDArray[np.bool_], basis: F4, before: F4, count: int) -> tuple[F4, F4]:
    """Least squares over the calm places, the shape held near what it was.

    Returns the drift, and the sum of squares that its change explains, by LED.
    """
    left = (means - np.tensordot(before, basis, axes=1))[:, calm]
    known = basis[:count, calm]
    held = np.full(count, HELD * calm.size, np.float32)
    held[0] = 0
    seen = known @ left.T
    change = np.linalg.solve(known @ known.T + np.diag(held), seen)
    drift = before.copy()
    drift[:, :count] += change.T
    return drift, np.asarray((change * seen).sum(axis=0), np.float32)


@film_drift.opencl(on_cpu="a dozen small kernels for a few thousand places")
def _launch(run: Launch) -> None:
    light, out = run.inputs["light"], run.outputs["film_drift"]
    sigma, before = run.inputs.get("sigma"), run.inputs.get("before")
    lights, height, width = image = [run.sizes[name] for name in "KHW"]
    rows, columns = places = [-(-height // STEP), -(-width // STEP)]
    sizes = (*image, *places)
    means, noise = run.scratch((lights, rows, columns)), run.scratch((lights, rows, columns))
    share = 0.0 if sigma is None else float(run.settings["level"]) / (2 * REACH + 1)
    seen = light if sigma is None else sigma
    run.kernel("places", (lights, rows, columns), light, seen, means, noise, *sizes, share)

    shape = (lights, TERMS)
    old, drift, spare = run.scratch(shape), run.scratch(shape), run.scratch(shape)
    each = (lights * TERMS,)
    run.kernel(
        "begin", each, out if before is None else before, old, int(before is not None), lights
    )
    group = (GROUP,)
    run.kernel("border_level", (lights * GROUP,), means, old, spare, *sizes[1:], local=group)
    counts = run.scratch((2 * WORKERS,), np.int32)
    rough = float(run.settings["rough"])
    widest = rough + SEARCH[0]
    run.kernel("count_calm", (WORKERS,), means, noise, old, spare, counts, *sizes, widest)
    run.kernel("choose", each, old, spare, counts, drift, lights)

    sums, explained = run.scratch((SUMS * WORKERS,)), run.scratch((lights,))
    few, count = run.scratch((1,), np.int32), TERMS_OF[run.settings["degree"]]
    for number, beyond in enumerate(SEARCH):
        tally = (means, noise, drift, old, sums, *sizes, rough + beyond)
        run.kernel("tally", (WORKERS,), *tally)
        run.kernel("watch", (1,), sums, few, rows * columns, int(number == 0))
        rate = float(run.settings["rate"]) if number == len(SEARCH) - 1 else 1.0
        run.kernel(
            "settle", (lights,), sums, old, spare, explained, lights, rows * columns, count, rate
        )
        drift, spare = spare, drift
    run.kernel("tally", (WORKERS,), means, noise, spare, drift, sums, *sizes, rough + SEARCH[-1])
    run.kernel("finish", (lights,), sums, old, drift, explained, few, out, lights)


@film_drift.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A film at rest whose LEDs have drifted, with a touch in a quarter of it."""
    before = np.zeros((K, TERMS))
    before[:, 0] = rng.uniform(0.95, 1.05, K)
    before[:, 1:] = rng.uniform(-0.02, 0.02, (K, TERMS - 1))
    drift = before + rng.uniform(-0.01, 0.01, (K, TERMS))
    light = np.tensordot(drift, terms(np.arange(H), np.arange(W), (H, W)), axes=1)
    light += rng.normal(0, 0.002, light.shape)
    light[:, : H // 2, : W // 2] *= rng.uniform(0.3, 1.5, (K, H // 2, W // 2))
    sigma = np.full((K, H, W), 0.002)
    return {
        "light": light.astype(np.float32),
        "sigma": sigma.astype(np.float32),
        "before": before.astype(np.float32),
    }
