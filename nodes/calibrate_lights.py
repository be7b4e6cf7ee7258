"""Find where the LEDs are, from the untouched film and one object of known shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, map_coordinates
from scipy.optimize import least_squares

from tactograph.graph import InputError, Port, SizeLimit, node
from tactograph.nodes import F4, Height, Labels, Light, LightPositions, Mask, PixelSize, Slope
from tactograph.nodes._near_light import F8, places

BLOCKS = 32
"""The flat frame is averaged in square blocks, so many along the image: light is smooth there."""
SAMPLES = 3000
"""So many pixels of the object determine twenty numbers to a thousandth."""
FEWEST = 100
DIM = 0.05
"""Light below this may be half shadow."""
SPREAD = 0.006
"""Standard deviation of light that the fit aims at; beyond twice that a pixel is an outlier."""
FARTHEST = 1e6
"""Distance in mm that stands for infinity."""
ROOM = 3
"""Pixels at the edge of the known shape that a shift could carry beyond it."""


class LightsFit(NamedTuple):
    """The LEDs, and what the fit leaves over."""

    lights: LightPositions
    strength: Annotated[F4, Port("K", "1")]
    residual: Annotated[F4, Port("K", "1")]


@dataclass(frozen=True)
class _Object:
    """Samples of the known shape: N places, the light there (K x N) and whether it counts."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    light: F8
    lit: NDArray[np.bool_]
    x: F8
    y: F8
    normal: F4
    height: F4

    def moved(self, shift: F8) -> tuple[F8, F8]:
        """Unit normals 3 x N and heights N of the shape moved by `shift` = (x, y) in px."""
        where = np.stack([self.rows - shift[1], self.columns - shift[0]])
        # n_x and n_y are linear on a ball: interpolating them, not the slope, is exact there.
        nx, ny, z = (
            map_coordinates(plane, where, output=np.float64, order=1, mode="nearest")
            for plane in (*self.normal, self.height)
        )
        return np.stack([nx, ny, np.sqrt(np.maximum(1 - nx * nx - ny * ny, 1e-4))]), z


@dataclass(frozen=True)
class _Rest:
    """The flat frame: logarithm of block means, less their mean over the LEDs; K x N."""

    logarithm: F8
    x: F8
    y: F8
    block: int


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def calibrate_lights(
    light: Light,
    flat: Light,
    slope: Slope,
    mask: Mask,
    height: Height,
    lit: Labels,
    pixel: PixelSize,
    *,
    steepest: Annotated[float, Gt(0)] = 3.0,
    shift_px: Annotated[float, Gt(0)] = 0.5,
) -> LightsFit:
    """Fit the LEDs' positions to a known shape's light and to the fall-off over the film.

    Robust least squares (Huber) over two kinds of evidence: on the object, the light
    relative to the film at rest is n.v (`_near_light`, N1); on the film at rest, each LED's
    light falls off as L_z / |L - P_0|^3, up to a gain that all share.  An LED is described
    by L_x / L_z, L_y / L_z, 1 / L_z, which stay finite for a distant one, and a strength;
    the place of the object is refined with them.

    Parameters
    ----------
    light
        K x H x W of the object, relative to the film at rest.
    flat
        K x H x W, the film at rest.  Where it is uniform there was none: then the positions
        come from the object alone, and `light` is what was captured.
    slope, mask, height
        2 x H x W, H x W, H x W in mm: the object, where known.
    lit
        H x W, the LEDs that reach each pixel.
    pixel
        mm per px.
    steepest
        Pixels steeper than this (mm per mm) are left out: there shape is least certain.
    shift_px
        Standard deviation of the object's place along x and along y.

    Returns
    -------
    LightsFit
        Positions K x 3 in mm from the middle of the image; strength K, the light of the film
        at rest in the middle of the image, where the flat frame is missing (else 1); the
        root mean square that the fit leaves on the object, of length K.

    Raises
    ------
    InputError
        If an LED reaches fewer than 100 pixels of the object.
    """
    there = _object(light, slope, mask, height, lit, pixel, steepest)
    rest = None if _uniform(flat) else _rest(flat, pixel)
    return _fit(there, rest, shift_px, width_mm=pixel * light.shape[2])


def _uniform(flat: Light) -> bool:
    return all(np.ptp(plane) == 0 for plane in flat)


def _object(
    light: Light,
    slope: Slope,
    mask: Mask,
    height: Height,
    lit: Labels,
    pixel: float,
    steepest: float,
) -> _Object:
    """Choose the samples, evenly over the object."""
    p, q = slope
    nz = 1 / np.sqrt(1 + p * p + q * q)
    known = binary_erosion(mask > 0, iterations=ROOM, border_value=1)
    rows, columns = np.nonzero(known & (p * p + q * q < steepest * steepest))
    stride = max(1, int(np.sqrt(rows.size / SAMPLES)))
    chosen = (rows % stride == 0) & (columns % stride == 0)
    rows, columns = rows[chosen], columns[chosen]
    values = light[:, rows, columns].astype(np.float64)
    numbers = np.arange(len(light))[:, None]
    reached = (lit[rows, columns][None, :] >> numbers & 1 > 0) & (values > DIM)
    for k, count in enumerate(reached.sum(axis=1), start=1):
        if count * stride * stride < FEWEST:
            raise InputError(
                f"LED {k} reaches only {count * stride * stride} pixels of the calibration "
                f"object ({FEWEST} are needed): is it on?"
            )
    x = places(light.shape[2], np.float32(pixel)).astype(np.float64)[columns]
    y = places(light.shape[1], np.float32(pixel)).astype(np.float64)[rows]
    return _Object(rows, columns, values, reached, x, y, np.stack([-p * nz, -q * nz]), height)


def _rest(flat: Light, pixel: float) -> _Rest:
    count, rows, columns = flat.shape
    block = max(1, min(columns // BLOCKS, rows))
    down, across = rows // block, columns // block
    cut = flat[:, : down * block, : across * block].reshape(count, down, block, across, block)
    means = np.log(np.maximum(cut.mean(axis=(2, 4), dtype=np.float64), 1e-6))
    middle = (block - 1) / 2
    x = (np.arange(across) * block + middle - (columns - 1) / 2) * pixel
    y = (np.arange(down) * block + middle - (rows - 1) / 2) * pixel
    gx, gy = np.meshgrid(x, y)
    return _Rest((means - means.mean(axis=0)).reshape(count, -1), gx.ravel(), gy.ravel(), block)


def _fit(there: _Object, rest: _Rest | None, shift_px: float, width_mm: float) -> LightsFit:
    """Unknowns per LED: L_x / L_z, L_y / L_z, 1 / L_z, log strength; then the shift."""
    count = len(there.light)
    start = np.array([_distant(there, k, width_mm, rest is None) for k in range(count)])

    def residual(unknown: F8) -> F8:
        leds, shift = unknown[:-2].reshape(count, 4), unknown[-2:]
        parts = [shift / shift_px, _object_residual(there, leds, shift, rest is None) / SPREAD]
        if rest is not None:
            # The strengths' common factor is free: hold their mean.
            parts += [_rest_residual(rest, leds) / SPREAD, leds[:, 3:].mean(axis=0) / SPREAD]
        return np.concatenate([part.ravel() for part in parts])

    found = least_squares(
        residual,
        np.r_[start.ravel(), 0, 0],
        loss="huber",
        f_scale=2.0,
        x_scale="jac",
        max_nfev=60,
    ).x
    leds = found[:-2].reshape(count, 4)
    left = _object_residual(there, leds, found[-2:], rest is None)
    inverse = np.maximum(leds[:, 2:3], 1 / FARTHEST)
    lights = np.column_stack([leds[:, :2], np.ones(count)]) / inverse
    strength = np.exp(leds[:, 3]) if rest is None else np.ones(count)
    return LightsFit(
        lights.astype(np.float32), strength.astype(np.float32), _spread(left, there.lit)
    )


def _spread(left: F8, lit: NDArray[np.bool_]) -> F4:
    """Root mean square per LED over the pixels that it reaches."""
    return np.sqrt((left * left).sum(axis=1) / lit.sum(axis=1)).astype(np.float32)


def _distant(there: _Object, k: int, width_mm: float, captured: bool) -> F8:
    """A distant LED by linear least squares, moved to a few image widths."""
    normal, _ = there.moved(np.zeros(2))
    chosen = there.lit[k]
    if captured:
        a, *_ = np.linalg.lstsq(normal[:, chosen].T, there.light[k, chosen], rcond=None)
        gain = max(float(a[2]), 0.1)
        a = a[:2] / gain
    else:
        gain = 1.0
        rise = there.light[k, chosen] - normal[2, chosen]
        a, *_ = np.linalg.lstsq(normal[:2, chosen].T, rise, rcond=None)
    return np.array([*a, 0.2 / width_mm, np.log(gain)])


def _object_residual(there: _Object, leds: F8, shift: F8, captured: bool) -> F8:
    """Light less model, K x N; in units of L_z nothing grows as an LED moves away."""
    (nx, ny, nz), z = there.moved(shift)
    left = np.zeros_like(there.light)
    for k, (a, b, c, log_strength) in enumerate(leds):
        dx, dy, dz = a - c * there.x, b - c * there.y, 1 - c * z
        plan = dx * dx + dy * dy
        at_rest = (a * a + b * b + 1) * np.exp(log_strength / 1.5) if captured else plan + 1
        model = (nx * dx + ny * dy + nz * dz) * (at_rest / (plan + dz * dz)) ** 1.5
        left[k] = np.where(there.lit[k] & (model > DIM), there.light[k] - model, 0)
    return left


def _rest_residual(rest: _Rest, leds: F8) -> F8:
    """Logarithm of the flat frame less that of the model, the shared gain taken out."""
    model = np.empty_like(rest.logarithm)
    for k, (a, b, c, log_strength) in enumerate(leds):
        square = (a - c * rest.x) ** 2 + (b - c * rest.y) ** 2 + 1
        model[k] = log_strength - 1.5 * np.log(square)
    # The mean of a block is that many times less noisy than a pixel.
    return (rest.logarithm - (model - model.mean(axis=0))) * rest.block
