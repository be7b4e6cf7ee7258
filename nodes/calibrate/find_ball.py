"""Find the calibration ball: where it touches the film, and how large the contact is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from scipy import fft, ndimage, optimize

from tactograph.graph import InputError, Port, node
from tactograph.nodes import F4, Light, PixelSize

F8 = NDArray[np.float64]

LIT = 0.06
"""Light below this counts as shadow: neither the ball's shading nor the film at rest."""
NOISE = 0.01
"""Standard deviation of light that is not worth explaining; keeps noise from scoring."""
ACCEPTED = 0.45
"""Smallest goodness that is a ball: balls reach 0.48 to 0.99, other objects up to 0.38."""
SEARCH_WIDTH, REFINE_WIDTH = 64, 320
"""Widths in px that the image is reduced to for the two steps."""
REFINE_PIXELS = 3000
"""So many pixels determine three numbers; more cost time and gain nothing."""
LARGEST = 2
"""Largest contact that is searched for, in diagonals of the image."""
CONTACT_SHARES = (1.0, 0.85, 0.72, 0.61, 0.52, 0.44, 0.37, 0.31)
"""Contact radii that are tried first, as shares of the ball's radius."""
SMALLEST_SEARCHED = 3.0
"""Contact radius in px of the reduced image, below which there is nothing to tell a ball by."""
SEARCHED = (0.97, 1.06, 1.45)
"""Radii in contact radii: ball up to the first, film from the second to the third."""
JUDGED = (0.97, 1.3, 1.8)
"""The same for the goodness, once the contact is known: the film folds up to the second."""
CONTACT_TRIALS = tuple(np.linspace(0.85, 1.15, 16))
"""Contact radii tried before the last descent, relative to the search's."""
FOLD_KNOTS = (1.0, 1.07, 1.15, 1.25, 1.4, 1.6)
"""Radii, in contact radii, between which the film around the contact is interpolated."""
RIDGE = 1e-9
"""Relative to the trace; keeps the normal equations solvable where pixels are few."""


class Ball(NamedTuple):
    """Where the ball touches, and how sure that is."""

    center: Annotated[F4, Port("2", "px")]
    contact: Annotated[float, Port(unit="px")]
    goodness: Annotated[float, Port(unit="1")]


class _Circle(NamedTuple):
    """A contact circle in px."""

    x: float
    y: float
    radius: float

    def on(self, shrink: float) -> _Circle:
        """Return the same circle on the image reduced by `shrink`, pixel centres at integers."""
        x, y = (self.x + 0.5) / shrink - 0.5, (self.y + 0.5) / shrink - 0.5
        return _Circle(x, y, self.radius / shrink)


class _Samples(NamedTuple):
    """Pixels to fit: x, y of length N, light and lit K x N."""

    x: F8
    y: F8
    light: F8
    lit: F8


@node
def find_ball(
    light: Light,
    pixel: PixelSize,
    *,
    radius_mm: Annotated[float, Gt(0)],
    center_px: tuple[float, float] | None = None,
    contact_px: Annotated[float, Gt(0)] | None = None,
) -> Ball:
    """Return the contact circle of a ball of known radius.

    On the ball the unit normal is known, n = ((x - c_x)/R, (y - c_y)/R, sqrt(1 - n_x^2 - n_y^2)),
    and the light of an LED is close to linear in it (section 3.1: Lambert).  So for every
    circle that is tried, the light inside is fitted with 1, n_x, n_y, n_z and the light
    around it with a plain film, by linear least squares over the pixels an LED reaches; the
    circle that explains most is the contact (variable projection: Golub and Pereyra, 1973).
    First all centres at once on a reduced image, by correlation, for eight radii; then
    Nelder-Mead on the finer image, where the film around the contact may fold as it likes
    as long as it does so alike in all directions.

    Parameters
    ----------
    light
        K x H x W, K from 3; relative to the film at rest, or as captured.
    pixel
        mm per px.
    radius_mm
        The ball's radius.
    center_px
        x, y of the ball's centre, where it is known; it may lie outside the image.
    contact_px
        Radius of the contact circle in px, where it is known.

    Returns
    -------
    Ball
        Centre x, y in px (pixel centres at integers: where the ball is highest), the radius
        of the contact circle in px, and the goodness: the share of the light's variance in
        and around the contact, beyond a quadratic in x and y, that a ball on a plane
        explains.  1 is a perfect ball on an untouched film, 0 anything smooth.

    Raises
    ------
    InputError
        If no circle reaches a goodness of 0.45, unless centre and contact are both given; if
        the contact is given and larger than the ball.
    """
    radius = radius_mm / pixel
    if contact_px is not None and contact_px > radius:
        raise InputError(
            f"find_ball: contact_px={contact_px:g} is larger than the ball, whose radius_mm="
            f"{radius_mm:g} is {radius:.1f} px; correct contact_px, radius_mm or the pixel size"
        )
    _check_size(light, radius, radius_mm, contact_px)
    if center_px is not None and contact_px is not None:
        circle = _Circle(*center_px, contact_px)
        return _ball(circle, _goodness(light, circle, radius))
    seed = _search(light, radius, center_px, contact_px)
    circle = _refine(light, seed, radius, center_px, contact_px)
    goodness = _goodness(light, circle, radius)
    if goodness < ACCEPTED:
        raise InputError(
            f"no ball of radius {radius_mm:g} mm found in the calibration capture: the best "
            f"circle, at {circle.x:.0f},{circle.y:.0f} px, has a goodness of {goodness:.2f} and "
            f"{ACCEPTED:g} is needed; give its place "
            "(ball_center_px=x,y and ball_contact_px=r), or press again"
        )
    return _ball(circle, goodness)


def _check_size(light: F4, radius: float, radius_mm: float, contact: float | None) -> None:
    """Refuse a ball whose contacts all lie far beyond the image."""
    smallest = contact if contact is not None else radius * min(CONTACT_SHARES)
    diagonal = float(np.hypot(*light.shape[1:]))
    if smallest > LARGEST * diagonal:
        raise InputError(
            f"radius_mm={radius_mm:g}: the ball's contact of {smallest:.3g} px does not fit the "
            f"image of {light.shape[2]} x {light.shape[1]} px; check ball_radius_mm, "
            "ball_contact_px and the pixel size"
        )


def _ball(circle: _Circle, goodness: float) -> Ball:
    return Ball(np.array([circle.x, circle.y], np.float32), float(circle.radius), goodness)


def _reduce(light: F4, width: int) -> tuple[F4, float]:
    """Return the light averaged down to at most `width` px, and the factor."""
    shrink = max(light.shape[2] / width, 1.0)
    size = (round(light.shape[2] / shrink), max(round(light.shape[1] / shrink), 1))
    return np.stack([cv2.resize(i, size, interpolation=cv2.INTER_AREA) for i in light]), shrink


def _search(
    light: F4, radius: float, center: tuple[float, float] | None, contact: float | None
) -> _Circle:
    """Return the best circle on a grid of centres and radii."""
    small, shrink = _reduce(light, SEARCH_WIDTH)
    radii = [radius * s for s in CONTACT_SHARES] if contact is None else [contact]
    radii = [r for r in radii if r <= LARGEST * np.hypot(*light.shape[1:])]
    radii = [r for r in radii if r >= SMALLEST_SEARCHED * shrink] or [max(radii)]
    best, found = -1.0, _Circle(0, 0, radii[0])
    for r in radii:
        pad = int(0.6 * r / shrink)
        share = _share_everywhere(small, radius / shrink, r / shrink, pad)
        if center is not None:
            share = _only_at(share, _Circle(*center, r).on(shrink), pad)
        y, x = np.unravel_index(int(share.argmax()), share.shape)
        if share[y, x] > best:
            best = float(share[y, x])
            found = _Circle(float(x) - pad, float(y) - pad, r / shrink).on(1 / shrink)
    return found if center is None else _Circle(*center, found.radius)


def _only_at(share: F8, circle: _Circle, pad: int) -> F8:
    """Blank all but the grid point nearest to a given centre."""
    y = int(np.clip(round(circle.y) + pad, 0, share.shape[0] - 1))
    x = int(np.clip(round(circle.x) + pad, 0, share.shape[1] - 1))
    only = np.full_like(share, -1)
    only[y, x] = share[y, x]
    return only


def _share_everywhere(light: F4, radius: float, contact: float, pad: int) -> F8:
    """Return the goodness of a contact circle around every pixel, `pad` px beyond the image."""
    around = ((0, 0), (pad, pad), (pad, pad))
    lit = np.pad((light > LIT).astype(np.float64), around)
    image = np.pad(light.astype(np.float64), around) * lit
    reach = int(np.ceil(SEARCHED[2] * contact))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    ball, smooth, window = _bases(x / contact, y / contact, radius / contact, SEARCHED)
    power = _correlate(image * image, window[None])[:, 0]
    left_by_ball = _residual_everywhere(image, lit, ball, power)
    left_by_smooth = _residual_everywhere(image, lit, smooth, power)
    share = _share(left_by_ball, left_by_smooth, window.sum() * len(light))
    seen = _correlate(lit, ball[:1])[:, 0].sum(0) / (ball[0].sum() * len(light))
    # Most of the disk in shadow or outside the image: too little to tell a ball by.
    return np.where(seen < 0.3, 0.0, share)


def _bases(u: F8, v: F8, radius: float, rings: tuple[float, float, float]) -> tuple[F8, F8, F8]:
    """Return what a ball on a plane and what a smooth film look like, and where to look.

    `u`, `v` and `radius` are in contact radii.  The columns come first.
    """
    r = np.hypot(u, v)
    inside = (r < rings[0]).astype(np.float64)
    outside = ((r > rings[1]) & (r < rings[2])).astype(np.float64)
    window = inside + outside
    rise = _rise(r, radius)
    ball = np.stack([inside, inside * u, inside * v, inside * rise, *_plane(outside, u, v)])
    smooth = np.stack([*_plane(window, u, v), window * u * u, window * u * v, window * v * v])
    return ball, smooth, window


def _plane(where: F8, u: F8, v: F8) -> Iterator[F8]:
    yield from (where, where * u, where * v)


def _rise(r: F8, radius: float) -> F8:
    """Return n_z of the ball, 0 beyond its rim."""
    return np.sqrt(np.maximum(1 - (r / radius) ** 2, 0))


def _share(ball: F8, smooth: F8, pixels: float) -> F8:
    """Return the share of what a smooth film leaves (K x ...) that the ball explains."""
    left = np.maximum(smooth, 0).sum(0)
    return (left - np.maximum(ball, 0).sum(0)) / (left + NOISE**2 * pixels)


def _correlate(images: F8, kernels: F8) -> F8:
    """Return every kernel (N x odd x odd) laid over every image (K x H x W): K x N x H x W."""
    half, (height, width) = kernels.shape[-1] // 2, images.shape[-2:]
    size = [fft.next_fast_len(n + 2 * half, real=True) for n in (height, width)]
    spectrum = fft.rfft2(images, size)[:, None] * np.conj(fft.rfft2(kernels, size))
    shifted = np.roll(fft.irfft2(spectrum, size), (half, half), (-2, -1))
    return np.asarray(shifted[..., :height, :width])


def _residual_everywhere(image: F8, lit: F8, basis: F8, power: F8) -> F8:
    """Return the sum of squares that a basis laid over each pixel leaves: K x H x W."""
    n = len(basis)
    i, j = np.triu_indices(n)
    products = _correlate(lit, basis[i] * basis[j])
    normal = np.empty((*power.shape, n, n))
    normal[..., i, j] = normal[..., j, i] = np.moveaxis(products, 1, -1)
    right = np.moveaxis(_correlate(image, basis), 1, -1)
    # Products by FFT are exact to about 1e-13 of the largest: hence the stronger ridge.
    return power - _explained(normal, right, ridge=1e-6)


def _explained(normal: F8, right: F8, ridge: float = RIDGE) -> F8:
    """Return the sum of squares that the least-squares solution accounts for."""
    trace = np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    damped = normal + (ridge * trace + 1e-12) * np.eye(normal.shape[-1])
    return np.sum(np.linalg.solve(damped, right[..., None])[..., 0] * right, axis=-1)


def _refine(
    light: F4,
    seed: _Circle,
    radius: float,
    center: tuple[float, float] | None,
    contact: float | None,
) -> _Circle:
    """Return the circle near `seed` that explains the light best, to a fraction of a pixel."""
    reduced, shrink = _reduce(light, REFINE_WIDTH)
    circle = seed.on(shrink)
    limit = radius / shrink
    samples = _sample(reduced, circle, FOLD_KNOTS[-1])
    place = [] if center is not None else [0, 1]
    size = [] if contact is not None else [2]
    # From the search the centre is known to about a tenth of the contact.
    circle = _descend(samples, circle, limit, place, 0.1)
    if size:
        circle = min(
            (circle._replace(radius=min(s * seed.radius / shrink, limit)) for s in CONTACT_TRIALS),
            key=lambda trial: _residual(samples, trial, limit),
        )
    return _descend(samples, circle, limit, place + size, 0.03).on(1 / shrink)


def _descend(
    samples: _Samples, start: _Circle, limit: float, free: list[int], step: float
) -> _Circle:
    """Return the circle of least residual; only the fields `free` move, first by `step` radii."""
    if not free:
        return start

    def circle(values: F8) -> _Circle:
        full = np.array(start)
        full[free] = values
        return _Circle(full[0], full[1], float(np.clip(full[2], 0.5 * start.radius, limit)))

    first = np.array(start)[free]
    corners = first - step * start.radius * np.vstack([np.zeros(len(free)), np.eye(len(free))])
    # No target for the residual: its scale is the light's, the circle's is the pixel.
    stop = {"initial_simplex": corners, "xatol": 0.02, "fatol": np.inf, "maxfev": 100}
    minimize: Any = optimize.minimize  # its stubs know no initial simplex
    result = minimize(
        lambda values: _residual(samples, circle(values), limit),
        first,
        method="Nelder-Mead",
        options=stop,
    )
    return circle(result.x)


def _sample(light: F4, circle: _Circle, reach: float) -> _Samples:
    """Return evenly spread pixels up to `reach` contact radii from the centre."""
    y, x = np.indices(light.shape[1:])
    # Pixels at a shadow's edge are neither lit nor dark.
    lit = np.stack([ndimage.binary_erosion(i > LIT, border_value=1, iterations=2) for i in light])
    near = np.flatnonzero(np.hypot(x - circle.x, y - circle.y) < reach * circle.radius)
    near = near[:: near.size // REFINE_PIXELS + 1]
    values = light.reshape(len(light), -1)[:, near].astype(np.float64)
    shone = lit.reshape(len(light), -1)[:, near].astype(np.float64)
    return _Samples(x.flat[near].astype(float), y.flat[near].astype(float), values, shone)


def _residual(samples: _Samples, circle: _Circle, radius: float) -> float:
    """Return the sum of squares that a ball in a film that folds evenly around it leaves."""
    dx, dy = samples.x - circle.x, samples.y - circle.y
    r = np.hypot(dx, dy)
    # A pixel on the rim sees ball and film mixed by area.
    inside = np.clip(circle.radius - r + 0.5, 0, 1)
    ball = [inside, inside * dx / radius, inside * dy / radius, inside * _rise(r, radius)]
    away = np.maximum(r, 1e-9)
    turns = np.stack([np.ones_like(r), dx / away, dy / away])
    hats = [np.interp(r / circle.radius, FOLD_KNOTS, hat) for hat in np.eye(len(FOLD_KNOTS))]
    fold = ((1 - inside) * np.stack(hats))[:, None] * turns
    return float(_left(samples, np.vstack([ball, fold.reshape(-1, r.size)])).sum())


def _left(samples: _Samples, basis: F8) -> F8:
    """Return per LED the sum of squares that a basis (columns x N) leaves on lit pixels."""
    weighted = samples.lit * samples.light
    normal = np.stack([(basis * lit) @ basis.T for lit in samples.lit])
    power = np.sum(weighted * samples.light, axis=1)
    return power - _explained(normal, weighted @ basis.T)


def _goodness(light: F4, circle: _Circle, radius: float) -> float:
    reduced, shrink = _reduce(light, REFINE_WIDTH)
    small = circle.on(shrink)
    samples = _sample(reduced, small, JUDGED[2])
    u, v = (samples.x - small.x) / small.radius, (samples.y - small.y) / small.radius
    ball, smooth, window = _bases(u, v, radius / circle.radius, JUDGED)
    samples = samples._replace(lit=samples.lit * window)
    share = _share(_left(samples, ball), _left(samples, smooth), window.sum() * len(light))
    return float(np.clip(share, 0, 1))
