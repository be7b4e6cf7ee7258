"""Balls on a lattice: found in one image, placed together, then refined one by one.

A ball shows as a disc over which the LEDs' light differs, more so towards the rim.  The peaks of
the correlation with a template share an error of some hundredths of the pitch, since the LEDs
are not evenly spaced.  A lattice of known pitch is fitted to them.  A fit of the light with the
simplest model that real films need (diffuse share and gain) then places the balls.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from tactograph.nodes import F4, F8
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.film_fit import Fitting
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.optics.near_light import places

SEARCH_RADIUS_PX = 6.0
"""Radius in px of a ball in the reduced image that is searched."""
MIN_CORRELATION = 0.5
"""Correlation with the template above which a peak is a ball."""
REST_RADII = 1.3
"""Distance, in ball radii, at which the film around a ball is at rest again."""
FIRST_CONTACT_SHARE = 0.9
"""Initial contact radius, relative to the ball's, of a grid that is pressed in deeply."""
CONTACT_SHARES = FIRST_CONTACT_SHARE * 0.85 ** np.arange(6)
"""Contact radii that are tried, so close that a disc in between still shows."""
MAX_OFFSET_PITCHES = 0.15
"""Largest distance of a ball from the lattice, in pitches."""
LATTICE_ROUNDS = 6
"""Rounds that find the lattice's angle and place."""
SAMPLES_PER_BALL = 60
"""Samples per ball to place it."""
EDGE_START, EDGE_STEP = 0.5, 0.04
"""Radius, relative to the ball's, from which on the edge of a deep contact is searched for up to
the ball's own, and width of a ring."""
MAX_RESIDUAL_RATIO = 1.5
"""Residual, relative to the inner one, above which the film has left the ball."""
FAR_MM = 1e3


class Grid(NamedTuple):
    """Circles N x 3 in px (x, y, contact radius), and the correlation of each with a ball."""

    circle: F8
    goodness: F8


def find_grid(
    light: F4, radius_px: float, pitch_px: float, pixel: float, rest: Rest | None
) -> Grid | None:
    """Return the balls of a press that shows a lattice of balls; None if fewer than four.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    radius_px, pitch_px : radius of the balls, and pitch of the lattice
    pixel : mm per px
    rest : the flat frame in blocks, if there is one
    """
    best, share = Grid(np.zeros((0, 2)), np.zeros(0)), FIRST_CONTACT_SHARE
    for tried in CONTACT_SHARES:
        peaks, goodness = _peaks(light, radius_px * tried / FIRST_CONTACT_SHARE)
        if len(peaks) < 4:
            continue
        centre, inlier = _lattice(peaks, pitch_px)
        if goodness[inlier].sum() > best.goodness.sum():
            best, share = Grid(centre[inlier], goodness[inlier]), tried
    return place_balls(light, best, radius_px, pixel, rest, share)


def place_balls(
    light: F4,
    grid: Grid,
    radius_px: float,
    pixel: float,
    rest: Rest | None,
    share: float = FIRST_CONTACT_SHARE,
) -> Grid | None:
    """Return the balls that are wholly seen, placed by their light; None if fewer than four.

    As `find_grid`, for balls whose centres are known to some pixels, and of which about `share` of
    the radius is pressed in.
    """
    contact = np.full(len(grid.circle), share * radius_px)
    circle = np.column_stack([grid.circle[:, :2], contact])
    inside = _whole(circle, radius_px, light.shape[1:])
    if inside.sum() < 4:
        return None
    return Grid(
        _placed(light, circle[inside], radius_px, pixel, rest, share), grid.goodness[inside]
    )


def _peaks(light: F4, radius_px: float) -> tuple[F8, F8]:
    """Positions (x, y in px, N x 2) where the LEDs' light varies as over a ball; correlations."""
    factor = max(1, int(radius_px / SEARCH_RADIUS_PX))
    small = [
        cv2.resize(plane, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
        for plane in light
    ]
    spread = np.std(np.stack(small), axis=0).astype(np.float32)
    radius = radius_px / factor
    reach = int(np.ceil(1.05 * REST_RADII * radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    r = np.hypot(x, y) / radius
    template = np.where(
        r < FIRST_CONTACT_SHARE, r / FIRST_CONTACT_SHARE, np.clip((REST_RADII - r) / 0.4, 0, 1)
    )
    wide = cv2.copyMakeBorder(spread, reach, reach, reach, reach, cv2.BORDER_REFLECT)
    correlation = cv2.matchTemplate(wide, template.astype(np.float32), cv2.TM_CCOEFF_NORMED)
    peak = (correlation == maximum_filter(correlation, size=2 * int(1.6 * radius) + 1)) & (
        correlation > MIN_CORRELATION
    )
    rows, columns = np.nonzero(peak)
    where = np.column_stack([columns, rows]).astype(np.float64)
    return (where + 0.5) * factor - 0.5, correlation[rows, columns].astype(np.float64)


def _lattice(peaks: F8, pitch_px: float) -> tuple[F8, NDArray[np.bool_]]:
    """The lattice points nearest to the peaks, for a known pitch, and which peaks are close."""
    away = peaks[:, None] - peaks[None]
    near = np.abs(np.hypot(away[..., 0], away[..., 1]) / pitch_px - 1) < MAX_OFFSET_PITCHES
    # Four times the angle (modulo 2 pi) is the same for all neighbours on a square lattice.
    angle = np.angle(np.exp(4j * np.arctan2(away[near][:, 1], away[near][:, 0])).sum()) / 4
    for _ in range(LATTICE_ROUNDS):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        place = (peaks @ turn.T) / pitch_px
        phase = np.exp(2j * np.pi * place).mean(axis=0)
        offset = np.angle(phase) / (2 * np.pi)
        step = np.round(place - offset)
        off = place - offset - step
        inlier = np.hypot(off[:, 0], off[:, 1]) < MAX_OFFSET_PITCHES
        if not inlier.any():
            break
        # A rotation by d moves the point (a, b) by d (-b, a).
        spread = step[inlier] - step[inlier].mean(axis=0)
        turned = spread[:, 0] * off[inlier][:, 1] - spread[:, 1] * off[inlier][:, 0]
        angle += float(turned.sum() / max((spread**2).sum(), 1e-9))
    return (step + offset) * pitch_px @ turn, inlier


def _whole(circle: F8, radius_px: float, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Flags of the balls that the frame does not cut off."""
    x, y = circle[:, 0], circle[:, 1]
    inside = (x > radius_px) & (x < shape[1] - 1 - radius_px)
    return np.asarray(inside & (y > radius_px) & (y < shape[0] - 1 - radius_px))


def _placed(
    light: F4, circle: F8, radius_px: float, pixel: float, rest: Rest | None, share: float
) -> F8:
    """The circles after a fit of the balls' positions to the light."""
    deep = share / FIRST_CONTACT_SHARE
    balls = _samples(light, circle, 0.85 * deep * radius_px, radius_px, pixel)
    start = _start(balls)
    fitted = Fitting.of(balls, rest, {"plain"}).fitted(start)
    placed = circle.copy()
    placed[:, :2] += fitted.shifts[:, :2] / pixel
    placed[:, 2] = _contact(light, placed, radius_px, pixel, fitted, deep) * radius_px
    return placed


def _samples(light: F4, circle: F8, reach: float, radius_px: float, pixel: float) -> Balls:
    """Samples of all balls, spread evenly over each."""
    rows, columns = light.shape[1:]
    x, y = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    offsets = np.mgrid[-int(reach) - 1 : int(reach) + 2, -int(reach) - 1 : int(reach) + 2]
    dy, dx = offsets.reshape(2, -1)
    number, row, column = [], [], []
    for i, (u, v, _) in enumerate(circle):
        xx, yy = np.round(u).astype(int) + dx, np.round(v).astype(int) + dy
        inside = np.hypot(xx - u, yy - v) < reach
        inside &= (xx >= 0) & (xx < columns) & (yy >= 0) & (yy < rows)
        chosen = np.flatnonzero(inside)[:: inside.sum() // SAMPLES_PER_BALL + 1]
        number.append(np.full(chosen.size, i))
        row.append(yy[chosen])
        column.append(xx[chosen])
    at = np.concatenate(row), np.concatenate(column)
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    values = light[:, at[0], at[1]].astype(np.float64)
    return Balls(
        u=x[at[1]].astype(np.float64),
        v=y[at[0]].astype(np.float64),
        light=values,
        ball=np.concatenate(number),
        centre=(circle[:, :2] - middle) * pixel,
        rim=circle[:, 2] * pixel,
        radius=np.full(len(circle), radius_px * pixel),
        bounced=np.zeros_like(values),
        by_lift=np.zeros_like(values),
        by_rim=np.zeros_like(values),
        sector=np.zeros(values.shape[1], int),
        shift_mm=0.1 * radius_px * pixel,
        width_mm=pixel * columns,
    )


def _start(balls: Balls) -> Fitted:
    """Distant LEDs by linear least squares: light is a constant plus a product with the normal."""
    n, *_ = balls.surface(np.zeros((len(balls.centre), 3)), 0.0)
    basis = np.vstack([np.ones(n.shape[1]), n]).T
    planes, *_ = np.linalg.lstsq(basis, balls.light.T, rcond=None)
    ends = planes[1:3] / np.maximum(planes[3], 0.05)
    lights = np.vstack([ends, np.ones(ends.shape[1])]).T * FAR_MM * balls.radius.max()
    count = len(balls.centre)
    return Fitted.matt(lights.astype(np.float32), np.ones(len(lights), np.float32), count)


def _contact(
    light: F4, circle: F8, radius_px: float, pixel: float, fitted: Fitted, deep: float
) -> float:
    """The contact radius, relative to the ball's: up to there the film follows the balls."""
    edges = np.arange(EDGE_START * deep, 1.0, EDGE_STEP)
    balls = _samples(light, circle, edges[-1] * radius_px, radius_px, pixel)
    still = fitted._replace(shifts=fitted.shifts * [0, 0, 1])
    square = np.square(still.predicted(balls) - balls.light).mean(axis=0)
    middle = balls.centre[balls.ball]
    r = np.hypot(balls.u - middle[:, 0], balls.v - middle[:, 1]) / (radius_px * pixel)
    ring = np.digitize(r, edges)
    rings = (square[ring == i] for i in range(len(edges)))
    spread = np.array([np.sqrt(np.median(each)) if each.size else 0 for each in rings])
    beyond = np.flatnonzero(spread > MAX_RESIDUAL_RATIO * np.median(spread[:4]))
    return float(edges[beyond[0] - 1] if beyond.size and beyond[0] else edges[-1])
