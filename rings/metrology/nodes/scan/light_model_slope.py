"""Slope and brightness of every pixel from all LEDs, by a light model."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.rings.metrology.nodes.scan.light_model import (
    LightModel,
    coefficients,
    modelled_light,
    monomials,
)
from tactograph.sdk import (
    F4,
    Close,
    Labels,
    Light,
    Port,
    SizeLimit,
    Slope,
    SlopeNormal,
    in_blocks,
    node,
)

MAX_TURN_RAD = np.float32(0.3)
"""Longest step, as the angle in radians by which it turns the normal."""
MIN_STEP_RAD = np.float32(1e-3)
"""Convergence threshold: the step after one of this size would be a twentieth of it."""
MIN_LENGTH = np.float32(1e-20)
MIN_LIGHT = np.float32(1e-6)
"""Smallest sum of squares of the modelled light."""
MIN_START_Z = np.float32(0.05)
"""Smallest n_z of the start."""
MIN_EXPECTED_SHARE = np.float32(0.2)
"""Lower bound on an LED's expected light, over that of film at rest, of which a shadow has less
than half; both without diffused light."""


class ModelSlope(NamedTuple):
    """A slope, and what the light says beside it."""

    slope: Slope
    brightness: Annotated[F4, Port("H W", "1", high=2)]
    """The film's brightness, relative to the film that the model was made with."""
    residual: Annotated[F4, Port("H W", "1", high=0.1)]
    """Root mean square over the LEDs of the light that slope and brightness do not explain."""
    shadow: Labels
    """Bit k-1 is set where LED k does not light the pixel."""


@node(
    sizes={
        "K": SizeLimit(
            4, 8, "three lights tell no brightness: calibrate with the light model as start"
        )
    },
    tolerance=Close(
        1e-3, 5e-3, share=1e-3, why="LEDs that the model leaves dark come and go with a step"
    ),
)
def light_model_slope(
    light: Light, model: LightModel, *, steps: Annotated[int, Interval(ge=0, le=20)] = 4
) -> ModelSlope:
    """Find slope (p, q) and brightness g with I_k = g m_k(n), by least squares over the LEDs.

    At a given normal the best brightness is g = m.I / m.m, so Gauss-Newton steps turn the normal
    alone, by the part of dm that no brightness explains (variable projection, Kaufman 1975).
    The start is the linear model's.  Leaving LEDs out makes slopes worse under this model, so
    all count, those in shadow as well.  A pixel is in the shadow of an LED whose light, less what
    the gel diffuses, is below half of the model's, or of a fifth of that of film at rest.

    Parameters
    ----------
    light : K x H x W, a fraction of full scale
    model : as `read_light_model` gives it
    steps
        Gauss-Newton steps at most; after four, slopes of a real scan are within 5e-5 of the end
        at 99.9 % of the pixels.

    Returns
    -------
    Slope 2 x H x W; brightness, residual and shadow H x W.
    """
    leds, rows, columns = light.shape
    image = light.reshape(leds, -1)
    gain = None if model.gain is None else model.gain.reshape(leds, -1)
    out = np.empty((4, rows * columns), np.float32)
    shadow = np.empty(rows * columns, np.uint8)

    def solve(part: slice) -> None:
        at = np.arange(part.start, part.stop)
        u, v = model.u[at % columns], model.v[at // columns]
        rows_of_image = image[:, part] if gain is None else image[:, part] * gain[:, part]
        out[:, part], shadow[part] = _solution(rows_of_image, u, v, model, steps)

    in_blocks(solve, rows * columns)
    p, q, brightness, residual = out.reshape(4, rows, columns)
    return ModelSlope(np.stack([p, q]), brightness, residual, shadow.reshape(rows, columns))


def _solution(
    image: F4, u: F4, v: F4, model: LightModel, steps: int
) -> tuple[F4, NDArray[np.uint8]]:
    """4 x N: p, q, brightness and residual; and the labels."""
    powers = monomials(u, v, int(model.degree))
    terms = coefficients(model.quadratic, powers)
    p, q = _start(image, coefficients(model.linear, powers))
    moving = np.ones(p.shape, bool)
    for _ in range(steps):
        at = SlopeNormal(p, q)
        m, gradient = modelled_light(terms, np.array(at.normal))
        norm = np.sum(m * m, axis=0) + MIN_LIGHT
        brightness = np.sum(m * image, axis=0) / norm
        columns = at.by_slope(gradient)
        x, y = (brightness * (j - m * (np.sum(m * j, axis=0) / norm)) for j in columns)
        rest = image - brightness * m
        products = np.sum(x * x, axis=0), np.sum(x * y, axis=0), np.sum(y * y, axis=0)
        right = np.sum(x * rest, axis=0), np.sum(y * rest, axis=0)
        dp, dq = at.step(products, right, MAX_TURN_RAD)
        p, q = np.where(moving, p + dp, p), np.where(moving, q + dq, q)
        moving &= np.hypot(dp, dq) > MIN_STEP_RAD * at.square
        if not moving.any():
            break
    m, _ = modelled_light(terms, np.array(SlopeNormal(p, q).normal))
    brightness = np.sum(m * image, axis=0) / (np.sum(m * m, axis=0) + MIN_LIGHT)
    residual = np.sqrt(np.mean((image - brightness * m) ** 2, axis=0))
    dark = model.dark[:, None]
    at_rest = modelled_light(terms, np.array([[0], [0], [1]], np.float32))[0]
    expected = np.maximum(m - dark, MIN_EXPECTED_SHARE * (at_rest - dark))
    shaded = image < brightness * (dark + np.float32(0.5) * expected)
    shadow = np.bitwise_or.reduce(shaded << np.arange(len(image))[:, None], axis=0)
    return np.stack([p, q, brightness, residual]), shadow.astype(np.uint8)


def _start(image: F4, rows: F4) -> tuple[F4, F4]:
    """The slope of the vector g n with the least squares of I_k - L_k.(g n), by Cramer's rule."""
    a = np.array([[np.sum(rows[i] * rows[j], axis=0) for j in range(3)] for i in range(3)])
    cofactors = np.cross(a[[1, 2, 0]], a[[2, 0, 1]], axis=1)
    x, y, z = np.einsum("ijn,jn->in", cofactors, np.sum(rows * image, axis=1))
    z = np.maximum(z, np.maximum(MIN_START_Z * np.sqrt(x * x + y * y + z * z), MIN_LENGTH))
    return -x / z, -y / z


light_model_slope.opencl(grid="H W", lanes="rows", integers="light")
