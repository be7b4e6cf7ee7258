"""Search an image for the contact of a ball of known radius: all centres at once, some radii.

Around every pixel, least squares fits the light with a ball on a plane and with a smooth film
(see `find_ball`).  The sums over pixels are correlations, computed by FFT.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from scipy import fft

from tactograph.nodes import F4, F8

MIN_LIT_LIGHT = 0.06
"""Light below this counts as shadow: neither the ball's shading nor the film at rest."""
LIGHT_DEVIATION = 0.01
"""Standard deviation of light that need not be explained; it keeps noise from scoring."""
SEARCH_WIDTH_PX = 64
"""Width in px to which the image is reduced."""
MAX_CONTACT_DIAGONALS = 2
"""Largest contact that is searched for, in diagonals of the image."""
CONTACT_SHARES = (1.0, 0.85, 0.72, 0.61, 0.52, 0.44, 0.37, 0.31)
"""Contact radii that are tried first, as shares of the ball's radius."""
SHALLOW_SHARES = (0.31, 0.26, 0.22, 0.185, 0.155, 0.13, 0.11, 0.095)
"""Radii tried where the first ones show no ball, or a ball smaller than all of them."""
MIN_SEARCH_RADIUS_PX = 3.0
"""Smallest contact radius in px of the reduced image at which a ball can be recognised."""
SEARCH_RADII = (0.97, 1.06, 1.45)
"""Radii in contact radii: ball up to the first, film from the second to the third."""


class Circle(NamedTuple):
    """A contact circle in px."""

    x: float
    y: float
    radius: float

    def on(self, shrink: float) -> Circle:
        """Return the same circle on the image reduced by `shrink`, pixel centres at integers."""
        x, y = (self.x + 0.5) / shrink - 0.5, (self.y + 0.5) / shrink - 0.5
        return Circle(x, y, self.radius / shrink)


def search_ball(
    light: F4,
    radius: float,
    center: tuple[float, float] | None,
    contact: float | None,
    shares: Sequence[float] = CONTACT_SHARES,
) -> Circle:
    """Return the best circle on a grid of centres and radii."""
    small, shrink = reduced_to(light, SEARCH_WIDTH_PX)
    radii = [radius * s for s in shares] if contact is None else [contact]
    radii = [r for r in radii if r <= MAX_CONTACT_DIAGONALS * np.hypot(*light.shape[1:])]
    radii = [r for r in radii if r >= MIN_SEARCH_RADIUS_PX * shrink] or [max(radii)]
    best, circle = -1.0, Circle(0, 0, radii[0])
    for r in radii:
        pad = int(0.6 * r / shrink)
        share = _share_everywhere(small, radius / shrink, r / shrink, pad)
        if center is not None:
            share = _only_at(share, Circle(*center, r).on(shrink), pad)
        y, x = np.unravel_index(int(share.argmax()), share.shape)
        if share[y, x] > best:
            best = float(share[y, x])
            circle = Circle(float(x) - pad, float(y) - pad, r / shrink).on(1 / shrink)
    return circle if center is None else Circle(*center, circle.radius)


def reduced_to(light: F4, width: int) -> tuple[F4, float]:
    """Return the light averaged down to at most `width` px, and the factor."""
    shrink = max(light.shape[2] / width, 1.0)
    size = (round(light.shape[2] / shrink), max(round(light.shape[1] / shrink), 1))
    return np.stack([cv2.resize(i, size, interpolation=cv2.INTER_AREA) for i in light]), shrink


def _only_at(share: F8, circle: Circle, pad: int) -> F8:
    """Blank all grid points except the one nearest to a given centre."""
    y = int(np.clip(round(circle.y) + pad, 0, share.shape[0] - 1))
    x = int(np.clip(round(circle.x) + pad, 0, share.shape[1] - 1))
    only = np.full_like(share, -1)
    only[y, x] = share[y, x]
    return only


def _share_everywhere(light: F4, radius: float, contact: float, pad: int) -> F8:
    """Return the goodness of a contact circle around every pixel, `pad` px beyond the image."""
    around = ((0, 0), (pad, pad), (pad, pad))
    lit = np.pad((light > MIN_LIT_LIGHT).astype(np.float64), around)
    image = np.pad(light.astype(np.float64), around) * lit
    reach = int(np.ceil(SEARCH_RADII[2] * contact))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    u, v, shape = x / contact, y / contact, lit.shape
    inside, outside = _rings(np.hypot(u, v), SEARCH_RADII)
    # LEDs that reach the same pixels, as all do without shadows, have the same normal equations.
    reached = {plane.tobytes(): plane for plane in lit}
    pattern = [list(reached).index(plane.tobytes()) for plane in lit]
    planes = np.stack([*reached.values()])
    weights = _products(planes, u, v, radius / contact, inside, outside, pad)
    ball, film, smooth = (each[:, :, pattern] for each in weights)
    rise = rise_of(np.hypot(u, v), radius / contact)
    columns = [*(inside * each for each in (1, u, v, rise)), *_plane(outside, u, v)]
    columns += [(inside + outside) * each for each in (u * u, u * v, v * v)]
    right = np.moveaxis(_correlate(image, np.stack(columns), pad), 1, 0)
    right_of_smooth = np.concatenate([right[:3] + right[4:7], right[7:]])
    power = _correlate(image * image, (inside + outside)[None], pad)[:, 0]
    # Inside and outside share no pixel, so two small systems replace one.
    # Products by FFT are accurate to about 1e-13 of the largest: hence the stronger ridge.
    damping = 1e-6 * (np.trace(ball) + np.trace(film)) + 1e-12
    by_ball = _explained_everywhere(ball, right[:4], damping)
    by_ball += _explained_everywhere(film, right[4:7], damping)
    by_smooth = _explained_everywhere(smooth, right_of_smooth, 1e-6 * np.trace(smooth) + 1e-12)
    pixels = (inside + outside).sum() * shape[0]
    share = share_of(power - by_ball, power - by_smooth, pixels)
    ball_light = ball[0, 0].sum(0) / (inside.sum() * shape[0])
    # With most of the disk in shadow or outside the image, a ball cannot be recognised.
    return np.where(ball_light < 0.3, 0.0, share)


def _products(
    lit: F8, u: F8, v: F8, radius: float, inside: F8, outside: F8, pad: int
) -> tuple[F8, F8, F8]:
    """Return the normal equations around every pixel of what `bases` returns.

    They are those of the ball (n x n x ...), of the plane around it, and of the smooth film.
    FFTs take most of the time, so no product is correlated with the image twice.
    """
    rise = rise_of(np.hypot(u, v), radius)
    # Powers of u and v in all monomials up to the fourth order.
    flat = [(order - j, j) for order in range(5) for j in range(order + 1)]
    kernels = [outside * u**i * v**j for i, j in flat[:6]]
    kernels += [inside * u**i * v**j for i, j in flat[:6]]
    kernels += [inside * rise * each for each in (1, u, v)]
    kernels += [(inside + outside) * u**i * v**j for i, j in flat[6:]]
    laid = np.moveaxis(_correlate(lit, np.stack(kernels), pad), 1, 0)
    around, within, risen, window = laid[:6], laid[6:12], laid[12:15], laid[15:]
    # The square of the rise is a polynomial.
    squared = within[0] - (within[3] + within[5]) / radius**2
    ball = [*(within[i] for i in (0, 1, 2)), risen[0], within[3], within[4], risen[1]]
    ball += [within[5], risen[2], squared]
    moments = dict(zip(flat, [*(around + within), *window], strict=True))
    powers = flat[:6]
    smooth = [moments[i[0] + j[0], i[1] + j[1]] for n, i in enumerate(powers) for j in powers[n:]]
    return _symmetric(ball), _symmetric([around[i] for i in range(6)]), _symmetric(smooth)


def _symmetric(upper: Sequence[F8]) -> F8:
    """Return the matrix (n x n x ...) whose upper triangle is given row by row."""
    n = int((np.sqrt(8 * len(upper) + 1) - 1) / 2)
    products = np.empty((n, n, *upper[0].shape))
    for i, j, each in zip(*np.triu_indices(n), upper, strict=True):
        products[i, j] = products[j, i] = each
    return products


def _explained_everywhere(normal: F8, right: F8, damping: F8) -> F8:
    """Return the sum of squares that the solution of each system explains, matrix axes first.

    Elimination in all systems at once is many times faster than solving one after the other.
    """
    remaining, explained = right.copy(), np.zeros(right.shape[1:])
    normal = normal.copy()
    for k in range(len(right)):
        pivot = normal[k, k] + damping
        explained += remaining[k] * remaining[k] / pivot
        for i in range(k + 1, len(right)):
            factor = normal[k, i] / pivot
            remaining[i] -= factor * remaining[k]
            normal[i, i:] -= factor * normal[k, i:]
    return explained


def bases(u: F8, v: F8, radius: float, rings: tuple[float, float, float]) -> tuple[F8, F8, F8]:
    """Return the basis of a ball on a plane, that of a smooth film, and the window.

    `u`, `v` and `radius` are in contact radii.  The first axis numbers the basis functions.
    """
    r = np.hypot(u, v)
    inside, outside = _rings(r, rings)
    window = inside + outside
    rise = rise_of(r, radius)
    ball = np.stack([inside, inside * u, inside * v, inside * rise, *_plane(outside, u, v)])
    smooth = np.stack([*_plane(window, u, v), window * u * u, window * u * v, window * v * v])
    return ball, smooth, window


def _rings(r: F8, rings: tuple[float, float, float]) -> tuple[F8, F8]:
    """Return the windows of the ball and of the film around it."""
    inside = (r < rings[0]).astype(np.float64)
    return inside, ((r > rings[1]) & (r < rings[2])).astype(np.float64)


def _plane(where: F8, u: F8, v: F8) -> Iterator[F8]:
    yield from (where, where * u, where * v)


def rise_of(r: F8, radius: float) -> F8:
    """Return n_z of the ball, 0 beyond its rim."""
    return np.sqrt(np.maximum(1 - (r / radius) ** 2, 0))


def share_of(ball: F8, smooth: F8, pixels: float) -> F8:
    """Return the share of a smooth film's residual (K x ...) that the ball explains."""
    excess = np.maximum(smooth, 0).sum(0)
    return (excess - np.maximum(ball, 0).sum(0)) / (excess + LIGHT_DEVIATION**2 * pixels)


def _correlate(images: F8, kernels: F8, pad: int) -> F8:
    """Correlate every image (K x H x W) with every kernel (N x odd x odd): K x N x H x W.

    Images end in `pad` zeros on each side, so a kernel may reach so far around their ends.
    """
    half, (height, width) = kernels.shape[-1] // 2, images.shape[-2:]
    reach = max(half - pad, 0)
    size = [fft.next_fast_len(max(n + reach, 2 * half + 1), real=True) for n in (height, width)]
    spectrum = fft.rfft2(images, size)[:, None] * np.conj(fft.rfft2(kernels, size))
    shifted = np.roll(fft.irfft2(spectrum, size), (half, half), (-2, -1))
    return np.asarray(shifted[..., :height, :width])
