"""Find the film at rest, where it is no plane, from presses at several places.

Long because it searches for a bend, fits it together with LEDs and balls, and says how sure it is.
"""

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple, Self

import numpy as np
from annotated_types import Gt

from tactograph.rings.curved_film.nodes._coated_bend import Bending, coated_bend
from tactograph.rings.curved_film.nodes.read_rest import by_rays
from tactograph.sdk import (
    F4,
    F8,
    UM_PER_MM,
    InputError,
    Light,
    Metrics,
    NodeCall,
    PixelSize,
    Port,
    node,
    places,
)
from tactograph.sdk.nodes import film_bounce, find_balls, label_lit
from tactograph.sdk.unstable import (
    DERIVATIVE_STEP,
    BallOnShape,
    Circle,
    FilmEvidence,
    FoundBalls,
    LedFit,
    Noise,
    Object,
    Press,
    Radii,
    Rest,
    RestShape,
    ScaleError,
    SheetLight,
    StatedCircles,
    cut,
    descend,
    huber_weight,
    refined,
)

TRIED_BENDS = (0.0, 0.25, -0.25, 0.55, -0.55)
"""Bends that the search tries: half the diagonal of the frame over the radius."""
MAX_SAMPLES = 1500
"""Samples of each ball."""
SAMPLED_SHARE = 0.8
"""Share of a contact's radius whose pixels are samples, whatever the film's shape."""
INDEPENDENT_SAMPLES = 200
"""Most independent samples that a ball, or the flat frame under an LED, counts as, because what a
model leaves is smooth."""
MIN_PRESSES = 2
"""Fewest presses that tell of a bend."""
MAX_SLANT = 0.98
"""Largest sine of the film's slant."""


class _Trial(NamedTuple):
    """Balls and LEDs on a film of some shape."""

    circles: list[Circle]
    objects: list[Object]
    rest: Rest | None
    placed: LedFit


class Bend(NamedTuple):
    """A film's curvatures xx, xy, yy in 1/mm and slopes x, y in the middle; their covariance."""

    unknowns: F8
    covariance: F8
    trial: _Trial

    @property
    def residuals(self) -> F8:
        """Residuals of balls and flat frame."""
        return self.trial.placed.residuals(self.trial.objects, self.trial.rest)

    @property
    def cost(self) -> float:
        """Huber's loss of a residual, on average."""
        trial = self.trial
        return trial.placed.cost(trial.objects, trial.rest) / self.residuals.size

    def likelihood(self) -> float:
        """Return -2 log of the likelihood: residuals are of unknown spread."""
        return self.samples * math.log(self.cost)

    @property
    def samples(self) -> float:
        """Independent samples that tell of it."""
        lights = len(self.trial.placed.leds)
        each = [min(ball.light.shape[1], INDEPENDENT_SAMPLES) for ball in self.trial.objects]
        at_rest = INDEPENDENT_SAMPLES if self.trial.rest is not None else 0
        return lights * float(sum(each) + at_rest)


class FoundRest(NamedTuple):
    """The film at rest: its height at the camera's resolution, its shape, and figures."""

    height: Annotated[F4, Port("R C", "mm", low=-1, high=5)]
    shape: RestShape
    quality: Metrics
    scale_error: ScaleError = 0.0


class BallPresses(NamedTuple):
    """What the search looks at: presses of one ball each, K x H x W, and the film at rest.

    `radius` is in mm, `pixel` in mm per px at height 0, `camera` one over the pupil's height.
    """

    light: list[F4]
    flat: F4
    circles: list[Circle]
    radius: F4
    noise: F4
    pixel: float
    camera: float

    @classmethod
    def of(
        cls,
        balls: FoundBalls | FilmEvidence,
        light: F4,
        flat: F4,
        noise: F4,
        pixel: float,
        camera: float,
    ) -> Self:
        """Return the presses of a sheet that show one of the balls, each alone."""
        sheets, shown = cut(light, flat.shape[1]), np.flatnonzero(balls.circle[:, 2] > 0)
        circles = [Circle(*map(float, c)) for c in balls.circle[shown]]
        alone = [sheets[press] for press in balls.of[shown]]
        return cls(alone, flat, circles, balls.radius[shown], noise, pixel, camera)

    @property
    def radii(self) -> list[float]:
        """The balls' radii in mm."""
        return self.radius.tolist()

    @property
    def half(self) -> float:
        """Half the diagonal of the frame in mm."""
        return float(np.hypot(*self.flat.shape[1:])) * self.pixel / 2

    @property
    def unit(self) -> F8:
        """Unit of each unknown of a bend: half the diagonal rises by as much."""
        return np.array([1, 1, 1, 0, 0]) / self.half + np.array([0, 0, 0, 1, 1])

    def shape(self, unknowns: F8) -> RestShape:
        size = self.flat.shape[1], self.flat.shape[2]
        return bent(size, self.pixel, self.camera, unknowns)


@node
def find_rest(
    light: SheetLight,
    flat: Light,
    even: Annotated[F4, Port("K R C", "1")],
    radius: Radii,
    circles: StatedCircles,
    names: list[str],
    pixel: PixelSize,
    even_pixel: PixelSize,
    factor: int,
    noise: Noise,
    stated: RestShape | None = None,
    *,
    camera_mm: Annotated[float, Gt(0)] | None = None,
    bounce: NodeCall = film_bounce,
) -> FoundRest:
    """Return the film's shape at rest as given, or else as found.

    Parameters
    ----------
    light, flat : K x S x W presses relative to the film at rest, and K x H x W
    even : K x R x C, the film at rest at the camera's resolution
    radius, circles, names : of the presses, as for `find_balls`
    pixel, even_pixel : mm per px at height 0, of `flat` and of `even`
    factor : pixels of `even` along a pixel of `flat`
    noise : (shot, read), a captured light I has the variance shot * I + read
    stated
        As `read_rest` returns it.  None: a bend is looked for (`fitted_bend`), and where the film
        has a coat, with it.
    camera_mm : height of the pupil above height 0

    Returns
    -------
    The height R x C in mm that each pixel sees, and the shape on the pixels of `flat`.  Where it
    was found, ``rest_radius_x_mm`` and ``rest_radius_y_mm``, and how well the film's height is
    known, ``rest_deviation_um``, root mean square over the frame; and the relative error of the
    heights above it that follows.

    Raises
    ------
    InputError
        If fewer than two presses show a ball, there is no flat frame, or the film has a coat and
        `camera_mm` is not given.
    """
    if stated is not None:
        return FoundRest(stated.height, stated.binned(factor), {})
    if Rest.of(flat, pixel) is None:
        raise InputError(
            "finding the film's shape needs `flat`: the untouched film's light tells it"
        )
    ball = find_balls(light, flat, radius, circles, names, pixel)
    if np.count_nonzero(ball.circle[:, 2]) < MIN_PRESSES:
        raise InputError(
            f"finding the film's shape needs presses at {MIN_PRESSES} places or more: one in the "
            "middle, others near the border"
        )
    camera = 0.0 if camera_mm is None else 1 / camera_mm
    presses = BallPresses.of(ball, light, flat, noise, pixel, camera)
    tried, _ = tried_bends(presses)
    is_stated = camera_mm is not None
    bend = _under_coat(presses, tried, bounce, is_stated) or fitted_bend(presses, tried)
    size = even.shape[1], even.shape[2]
    whole = bent(size, even_pixel, camera, bend.unknowns)
    deviation = _deviation(bend, flat.shape[1:], pixel)
    figures = {"rest_deviation_um": UM_PER_MM * deviation}
    for axis, k in (("x", bend.unknowns[0]), ("y", bend.unknowns[2])):
        figures[f"rest_radius_{axis}_mm"] = float(1 / k) if k else math.inf
    scale = _scale_error(bend, presses.radii)
    return FoundRest(whole.height, whole.binned(factor), figures, scale)


def _deviation(bend: Bend, size: tuple[int, ...], pixel: float) -> float:
    """Standard deviation of the film's height about its mean, root mean square over the frame."""
    y, x = (places(side, np.float32(pixel)).astype(np.float64) for side in size)
    x, y = (part[::8].ravel() for part in np.broadcast_arrays(x[None], y[:, None]))
    by = np.stack([x * x / 2, x * y, y * y / 2, x, y])
    by -= by.mean(axis=1, keepdims=True)
    return float(np.sqrt(np.einsum("an,ab,bn->n", by, bend.covariance, by).mean()))


def _scale_error(bend: Bend, radii: list[float]) -> float:
    """Relative error of all heights: a ball's curvature is known, the film's below it is not."""
    mean = np.array([1, 0, 1, 0, 0]) / 2
    rise = 1 / float(np.mean(radii)) + mean @ bend.unknowns
    return float(np.sqrt(mean @ bend.covariance @ mean) / abs(rise))


def bent(size: tuple[int, int], pixel: float, camera: float, unknowns: F8) -> RestShape:
    """Return a film of the curvatures K and slopes g: x'Kx / (1 + sqrt(1 - |Kx|^2)) + g x.

    A ball and a cylinder of any radius and axis are exact.
    """
    xx, xy, yy, gx, gy = unknowns

    def height(x: F8, y: F8) -> F8:
        kx, ky = xx * x + xy * y, xy * x + yy * y
        level = np.sqrt(1 - np.minimum(kx * kx + ky * ky, MAX_SLANT**2))
        return np.asarray((x * kx + y * ky) / (1 + level) + gx * x + gy * y)

    return RestShape.of(by_rays(size, pixel, camera, height).astype(np.float32), pixel, camera)


def tried_bends(presses: BallPresses) -> tuple[Bend, Bend]:
    """Return the one of several bends that explains balls and flat frame best, and none at all.

    Near LEDs light the ball and the film at rest under it from known directions.  So the light of a
    ball, relative to the film at rest, tells how that slopes under each contact, where the ball
    leaves the film tells how high it is, and the flat frame ties the places together.

    Parameters
    ----------
    presses : of one ball each
    """
    bends = []
    for bend in TRIED_BENDS:
        unknowns = np.array([1, 0, 1, 0, 0]) * bend / presses.half
        bends.append(Bend(unknowns, np.zeros((5, 5)), _placed(presses, unknowns, None)))
    return min(bends, key=lambda each: each.cost), bends[0]


def _under_coat(presses: BallPresses, bend: Bend, bounce: NodeCall, is_stated: bool) -> Bend | None:
    """The bend by a film's model with a coat; None where the film has none."""

    def lay(unknowns: F8) -> FilmEvidence:
        trial, count = _placed(presses, unknowns, bend.trial), len(presses.light)
        of, every = np.arange(count, dtype=np.int32), np.ones(count, np.uint8)
        balls = np.array(trial.circles, np.float32), presses.radius, of, every
        leds = trial.placed.lights, trial.placed.strength
        sheet, shape = np.concatenate(presses.light, axis=1), presses.shape(unknowns)
        known = sheet, presses.flat, *balls, *leds, presses.noise, presses.pixel, shape
        return FilmEvidence(*known)

    bending = Bending(presses.unit, is_stated, presses.shape, lay, bounce)
    coated = coated_bend(bending, bend.unknowns, bend.samples)
    return None if coated is None else bend._replace(unknowns=coated[0], covariance=coated[1])


def fitted_bend(presses: BallPresses, bend: Bend, *, only_ball: bool = False) -> Bend:
    """Return the best bend by least squares of bend, LEDs and balls together.

    Parameters
    ----------
    presses : of one ball each
    bend : one that is near
    only_ball : whether the film is a part of a ball, lowest or highest in the middle
    """
    ways = presses.unit * (np.array([[1, 0, 1, 0, 0]]) if only_ball else np.eye(5))

    def linear(now: Bend) -> Callable[[float], Bend]:
        residuals, trial, columns = now.residuals, now.trial, []
        for way in DERIVATIVE_STEP * ways:
            other = _on(presses, now.unknowns + way, trial.circles)
            after = trial.placed.residuals(*other)
            columns.append((after - residuals) / DERIVATIVE_STEP)
        by = trial.placed.jacobian(trial.objects, trial.rest)
        whole, weight = np.column_stack([by, *columns]), huber_weight(residuals)
        scale = np.sqrt(np.maximum(np.square(whole).sum(axis=0), 1e-30))
        whole = whole / scale
        square, down = whole.T @ (whole * weight[:, None]), -(whole.T @ (weight * residuals))
        # The variance of a residual, times how many of them count as one.
        alike = float(np.square(residuals).mean() * max(residuals.size / now.samples, 1))
        spread = np.linalg.pinv(square, hermitian=True) / np.outer(scale, scale) * alike
        spread = spread[-len(ways) :, -len(ways) :]

        def stepped(damping: float) -> Bend:
            step = np.linalg.solve(square + damping * np.eye(scale.size), down) / scale
            moved = now.unknowns + step[-len(ways) :] @ ways
            return Bend(moved, ways.T @ spread @ ways, _placed(presses, moved, trial))

        return stepped

    return descend(bend, Bend.likelihood, linear)


def _placed(presses: BallPresses, unknowns: F8, before: _Trial | None) -> _Trial:
    """Balls found anew on a film, and LEDs placed."""
    shape, near = presses.shape(unknowns), before is not None
    seeds = presses.circles if before is None else before.circles
    circles = [
        refined(light, seed, r / presses.pixel, None, None, BallOnShape(shape, r), near)
        for light, seed, r in zip(presses.light, seeds, presses.radii, strict=True)
    ]
    objects, rest = _on(presses, unknowns, circles)
    start = None if before is None else before.placed
    width = presses.pixel * presses.flat.shape[2]
    return _Trial(circles, objects, rest, LedFit.of(objects, rest, width, start))


def _on(
    presses: BallPresses, unknowns: F8, circles: list[Circle]
) -> tuple[list[Object], Rest | None]:
    """Samples of balls and flat frame on a film: the same pixels, whatever its shape."""
    shape, objects = presses.shape(unknowns), []
    for light, first, circle, radius in zip(
        presses.light, presses.circles, circles, presses.radii, strict=True
    ):
        on = BallOnShape(shape, radius)
        y, x = np.indices(light.shape[1:])
        away = np.hypot(x - first.x, y - first.y)
        near = (away < SAMPLED_SHARE * first.radius).astype(np.uint8)
        ball = on.slopes(circle, near)
        press = Press(light, ball.slope, near, ball.height, label_lit(light))
        objects.append(press.samples(presses.pixel, MAX_SAMPLES, shape))
    return objects, Rest.of(presses.flat, presses.pixel, shape)
