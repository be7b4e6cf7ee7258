"""An upper bound on the camera's blur from the brightness of folds, where film leaves a ball.

A fold a few pixels wide may be bent film or a blurred edge.  Bent film is as bright as its slopes
predict.  A blurred fold is darker: each pixel averages unit normals that differ, and their mean is
shorter than 1, to second order by half of the blur's variance times the square of the normal's turn
per pixel.  So the missing brightness, in proportion to that square, is the variance of the blur,
for any shape of the film.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import BAND_DEVIATIONS, F4, F8, Film, Light, Noise
from tactograph.nodes.calibrate import MIN_FLAT_LIGHT
from tactograph.nodes.calibrate.camera._ball_ring import BallRing
from tactograph.nodes.calibrate.film.film_misfit import BRIGHTENING_FACTOR
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.optics.film import FULL_MATT_LIGHT, direct_share, emitted, touch_gain
from tactograph.nodes.optics.near_light import places, vectors_at
from tactograph.nodes.trust.checked_cells import MIN_LEDS

HEIGHT_ROUNDS = 3
"""Alternations between slopes and the height, on which the direction of an LED depends."""
BIN_VARIANCE = 1 / 12
"""Variance in px^2 of the places within a bin; all have the bin's mean slope."""
MIN_WEIGHT = 1e-9
"""Least sum of a cell's normals or weights that is divided by."""


class Folds(NamedTuple):
    """Sums over the pixels of each fold, after a smooth trend is removed.

    With s half the square of the normal's turn per pixel: `lacking` is the sum of s times the
    missing brightness, `square` the sum of s squared, `largest` the largest s.
    """

    lacking: F8
    square: F8
    largest: F8

    def most_blur(self, uneven: float) -> float:
        """Return the largest blur in px that the brightness allows; infinity without a fold.

        The uncertainty includes the scatter of the folds, the unevenness of touched film, and, if
        folds are brighter than without a blur, that excess.
        """
        whole = self.square.sum()
        if whole == 0:
            return np.inf
        variance = self.lacking.sum() / whole
        scatter = np.sqrt(np.square(self.lacking - variance * self.square).sum()) / whole
        unlike = uneven / BRIGHTENING_FACTOR * (self.square / self.largest).sum() / whole
        deviation = np.sqrt(scatter**2 + unlike**2 + min(variance, 0) ** 2)
        most = max(variance, 0) + BAND_DEVIATIONS * deviation - BIN_VARIANCE
        return float(np.sqrt(max(most, 0)))


def tells_folds(film: Film) -> bool:
    """Return whether slopes predict the brightness: no coat, and no light from film to film."""
    return film.refraction == 1 and film.albedo == 0 and not film.harmonics.any()


def folds(
    image: Light, flat: Light, ring: BallRing, reach: int, film: Film, noise: Noise, pixel: float
) -> Folds:
    """Return the sums of the sharpest fold in each sector, over `reach` px on either side.

    Parameters
    ----------
    image, flat : K x H x W, as captured
    film : a plain one (`tells_folds`)
    pixel : mm per px
    """
    if not ring.inside.any():
        return Folds(*np.zeros((3, 0)))
    image, flat = image[:, ring.inside], flat[:, ring.inside]
    lit = _lit(ring, image, flat, film)
    angle, variance, brightness, weight = _bent(ring, lit, image, flat, film, noise, pixel)
    square, noise_of, tells = *np.zeros((2, *angle.shape)), np.zeros(angle.shape, bool)
    square[:, 1:-1] = np.square(angle[:, 2:] - angle[:, :-2]) / 8
    noise_of[:, 1:-1] = (variance[:, 2:] + variance[:, :-2]) / 8
    # A change of the LEDs in use changes the slant, which would look like a fold.
    alike = (lit[..., 1:] == lit[..., :-1]).all(axis=0)
    tells[:, 1:-1] = alike[:, 1:] & alike[:, :-1]
    # The slant is noisy where LEDs are nearly in line: a fold has to turn by more than its noise.
    square *= tells & (square > noise_of)
    tells &= noise_of < square.max(axis=1, keepdims=True)
    weight = weight * tells.ravel()[ring.cell]
    found = []
    for number, inner in enumerate(square[:, reach:-reach]):
        if not inner.any():
            continue
        far = (ring.bin - reach - int(np.argmax(inner))) / reach
        near = (ring.sector == number) & (np.abs(far) <= 1) & (weight > 0)
        root, far = np.sqrt(weight[near]), far[near]
        smooth = np.stack([np.ones_like(far), far, far * far], axis=1) * root[:, None]
        both = np.stack([brightness[near], square[number, ring.bin[near]]], axis=1) * root[:, None]
        both -= smooth @ np.linalg.lstsq(smooth, both, rcond=None)[0]
        found.append((-both[:, 0] @ both[:, 1], both[:, 1] @ both[:, 1], inner.max()))
    return Folds(*np.asarray(found).reshape(-1, 3).T)


def _lit(ring: BallRing, image: F4, flat: F4, film: Film) -> NDArray[np.bool_]:
    """Return the LEDs whose light reaches all pixels of a cell, K x sectors x bins."""
    dark = image < (FULL_MATT_LIGHT + film.diffuse[:, None]) * flat
    return np.stack([ring.mean(plane) == 0 for plane in dark])


def _bent(
    ring: BallRing,
    lit: NDArray[np.bool_],
    image: F4,
    flat: F4,
    film: Film,
    noise: Noise,
    pixel: float,
) -> tuple[F8, F8, F8, F8]:
    """Return the mean slant of a cell and its variance, a pixel's brightness and its weight.

    The height is the sum of the slopes from the outside inwards.
    """
    flat = np.maximum(flat, MIN_FLAT_LIGHT)
    seen, deviation = image / flat, light_noise(image, flat, noise)
    b, direct = film.diffuse[:, None], direct_share(film)[:, None]
    counts = lit.reshape(len(lit), -1)[:, ring.cell]
    y, x = (
        places(count, np.float32(pixel))[at]
        for count, at in zip(ring.inside.shape, np.nonzero(ring.inside), strict=True)
    )
    z = np.zeros(seen.shape[1])
    for _ in range(HEIGHT_ROUNDS):
        place = x, y, z.astype(np.float32)
        light = (seen / touch_gain(film, z) - b) / direct * counts / deviation
        shine = np.stack([emitted(film, k, place) + 0 * z for k in range(len(seen))])
        vectors = vectors_at(film.lights, *place) * (shine * counts / deviation)[:, None]
        # A normal is of length 1, which is all that too few LEDs leave known of it.
        by_normal = np.einsum("kin,kjn->nij", vectors, vectors) + np.eye(3)
        normal = np.linalg.solve(by_normal, np.einsum("kin,kn->ni", vectors, light)[..., None])
        nx, ny, nz = normal[..., 0].T
        outward = ring.mean(nx * ring.outward[0] + ny * ring.outward[1])
        angle = np.arctan2(outward, np.maximum(ring.mean(nz), MIN_WEIGHT))
        rise = np.tan(angle) * pixel
        z = (np.cumsum(rise[:, ::-1], axis=1)[:, ::-1] - rise / 2).ravel()[ring.cell]
    slant = angle.ravel()[ring.cell]
    tilted = np.stack([*(np.sin(slant) * ring.outward), np.cos(slant)])
    turned = np.stack([*(np.cos(slant) * ring.outward), -np.sin(slant)])
    spread = np.linalg.solve(by_normal, turned.T[..., None])[..., 0]
    variance = ring.mean((spread * turned.T).sum(axis=1)) / np.maximum(ring.counts, 1)
    expected = np.einsum("kin,in->kn", vectors, tilted)
    weight = np.square(expected).sum(axis=0)
    brightness = (expected * light).sum(axis=0) / np.maximum(weight, MIN_WEIGHT)
    return angle, variance, brightness, np.where(counts.sum(axis=0) >= MIN_LEDS, weight, 0)
