"""Find the film at rest, where it is no plane, from presses at several places."""

import math
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from tactograph.rings.curved_film.nodes.read_rest import by_rays
from tactograph.sdk import (
    F4,
    F8,
    FilmEvidence,
    InputError,
    Light,
    NodeCall,
    Noise,
    PixelSize,
    Port,
    RestShape,
    ScaleError,
    ShapeFit,
    SheetLight,
    StatedCircles,
    image_places,
    node,
)
from tactograph.sdk.nodes import calibrate_lights, film_bounce, find_balls, label_lit, press_slopes

COAT_PARTS = ("lobe",)
SHINING_PARTS = (*COAT_PARTS, "bounce")
"""Parts of a film with a coat, and of one that lights itself as well, as those with a coat do."""
MAX_ROUNDS = 12
"""Most rounds in which balls and LEDs are placed on a bend, and the bend is fitted to them."""
MIN_PRESSES = 2
"""Fewest presses that tell of a bend."""
MAX_SLANT = 0.98
"""Largest sine of the film's slant."""
FREE_BENDS = np.eye(5)
"""Ways in which a film bends: its curvatures xx, xy, yy and slopes x, y in the middle."""
BALL_BENDS = np.array([[1.0, 0, 1, 0, 0]])
"""The same of a part of a ball, lowest or highest in the middle."""


class FoundRest(NamedTuple):
    """The film at rest: its height at the camera's resolution, its shape, and figures."""

    height: Annotated[F4, Port("R C", "mm", low=-1, high=5)]
    shape: RestShape
    quality: dict[str, float]
    scale_error: ScaleError = 0.0


class Bend(NamedTuple):
    """A film's curvatures xx, xy, yy in 1/mm and slopes x, y in the middle; their covariance.

    `fit` is that of film, LEDs and balls on a film of this bend, or one that differs by no more
    than its error.
    """

    unknowns: F8
    covariance: F8
    fit: ShapeFit

    def deviation(self) -> float:
        """Return the film's height's standard deviation about its mean, over the frame."""
        size, pixel = self.fit.evidence.flat.shape, self.fit.evidence.pixel
        x, y = (part.astype(np.float64) for part in image_places(size[1:], pixel))
        x, y = (part[::8].ravel() for part in np.broadcast_arrays(x, y))
        by = np.stack([x * x / 2, x * y, y * y / 2, x, y])
        by -= by.mean(axis=1, keepdims=True)
        return float(np.sqrt(np.einsum("an,ab,bn->n", by, self.covariance, by).mean()))

    def scale_error(self) -> float:
        """Return the relative error of all heights.

        A ball's curvature is known, the film's below it is not.
        """
        mean = np.array([1, 0, 1, 0, 0]) / 2
        rise = 1 / float(np.mean(self.fit.evidence.radius)) + mean @ self.unknowns
        return float(np.sqrt(mean @ self.covariance @ mean) / abs(rise))


class Bending(NamedTuple):
    """Presses of one ball each on a film whose bend is not known.

    `evidence` takes it for a plane; `circles` are what is stated of the balls; `bends` are V x 5.
    """

    evidence: FilmEvidence
    circles: F4
    camera: float
    bends: F8 = FREE_BENDS
    bounce: NodeCall = film_bounce

    @property
    def ways(self) -> F8:
        """What a step of 1 adds to curvatures and slopes: half the frame's diagonal rises by it."""
        half = float(np.hypot(*self.evidence.flat.shape[1:])) * self.evidence.pixel / 2
        return self.bends * np.array([1 / half, 1 / half, 1 / half, 1, 1])

    def shape(self, unknowns: F8, step: F8 | float = 0.0) -> RestShape:
        """Return a film of some bend, or of that after a step."""
        _, rows, columns = self.evidence.flat.shape
        moved = unknowns + (step * self.ways.T).sum(axis=1)
        return bent((rows, columns), self.evidence.pixel, self.camera, moved)

    def fit(
        self, unknowns: F8, parts: tuple[str, ...] = (), before: ShapeFit | None = None
    ) -> ShapeFit:
        """Find the balls on a film of some bend, and fit the film's model to them."""
        data, shape = self.evidence, self.shape(unknowns)
        names = [str(1 + press) for press in range(len(data.radius))]
        circle, _, radius, of, _ = find_balls(
            data.light, data.flat, data.radius, self.circles, names, data.pixel, shape=shape
        )
        laid = data._replace(circle=circle, radius=radius, of=of, shape=shape)
        return ShapeFit.of(laid, parts, before, bounce=self.bounce)

    def found(self, parts: tuple[str, ...] = (), near: Bend | None = None) -> Bend:
        """Return the bend that explains balls and flat frame best, near another or a plane."""
        unknowns, _, fit = near or (np.zeros(5), None, None)
        ways, covariance = self.ways, np.zeros((5, 5))
        for _ in range(MAX_ROUNDS):
            fit = self.fit(unknowns, parts, fit)
            step = fit.step(partial(self.shape, unknowns), len(ways))
            unknowns, covariance = unknowns + step.step @ ways, ways.T @ step.covariance @ ways
            if step.is_small:
                break
        assert fit is not None
        return Bend(unknowns, covariance, fit)


@node
def find_rest(
    light: SheetLight,
    flat: Light,
    even: Annotated[F4, Port("K R C", "1")],
    radius: Annotated[F4, Port("P", "mm")],
    circles: StatedCircles,
    names: list[str],
    pixel: PixelSize,
    even_pixel: PixelSize,
    factor: int,
    noise: Noise,
    stated: RestShape | None = None,
    *,
    camera_mm: Annotated[float, Ge(1 / FilmEvidence.prior("camera").high)] | None = None,
    bounce: NodeCall = film_bounce,
) -> FoundRest:
    """Return the film's shape at rest as given, or else as found.

    Near LEDs light the ball and the film at rest under it from known directions.  So the light of a
    ball, relative to the film at rest, tells how that slopes under each contact, where the ball
    leaves the film tells how high it is, and the flat frame ties the places together.  A coat's
    mirror images and what the film throws on itself change the light as a bend does; fitted at once
    they are separated, since the flat frame shows both over the whole film.

    Parameters
    ----------
    light, flat : K x S x W presses relative to the film at rest, and K x H x W
    even : K x R x C, the film at rest at the camera's resolution
    radius, circles, names : of the presses, as for `find_balls`
    pixel, even_pixel : mm per px at height 0, of `flat` and of `even`
    factor : pixels of `even` along a pixel of `flat`
    noise : (shot, read), a captured light I has the variance shot * I + read
    stated
        As `read_rest` returns it.  None: a bend is looked for, together with LEDs and film, and
        with a coat where one explains the balls better by sure odds.
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
    if not np.ptp(flat, axis=(1, 2)).any():
        raise InputError(
            "finding the film's shape needs `flat`: the untouched film's light tells it"
        )
    # Light of film that is no plane may look like a ball's.
    balls = find_balls(light, flat, radius, circles, names, pixel, only_warn=True)
    found = np.flatnonzero(balls.circle[:, 2])
    if found.size < MIN_PRESSES:
        raise InputError(
            f"finding the film's shape needs presses at {MIN_PRESSES} places or more: one in the "
            "middle, others near the border"
        )
    light = np.concatenate([np.split(light, len(radius), axis=1)[press] for press in found], axis=1)
    circle, radius, every = balls.circle[found], radius[found], np.ones(found.size, np.uint8)
    of = np.arange(found.size, dtype=np.int32)
    contacts = press_slopes(light, flat, circle, radius, of, pixel)
    leds = calibrate_lights(light, flat, *contacts, label_lit(light), pixel)
    placed = leds.film.lights, leds.strength
    evidence = FilmEvidence(light, flat, circle, radius, of, every, *placed, noise, pixel)
    camera = 0.0 if camera_mm is None else 1 / camera_mm
    bending = Bending(evidence, circles[found], camera, bounce=bounce)
    bend = bending.found()
    coat = ShapeFit.of(bend.fit.evidence, COAT_PARTS, bend.fit)
    if coat.odds(bend.fit).are_sure:
        if camera_mm is None:
            raise InputError(
                "the film has a coat, and what that mirrors from near looks like a bend: to find "
                "both, give `camera_mm`, the height of the camera's pupil above the film (1e6: far "
                "away)"
            )
        bend = bending.found(SHINING_PARTS, bend._replace(fit=coat))
    whole = bent((even.shape[1], even.shape[2]), even_pixel, camera, bend.unknowns)
    figures = {"rest_deviation_um": 1e3 * bend.deviation()}
    for axis, k in (("x", bend.unknowns[0]), ("y", bend.unknowns[2])):
        figures[f"rest_radius_{axis}_mm"] = float(1 / k) if k else math.inf
    return FoundRest(whole.height, whole.binned(factor), figures, bend.scale_error())


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
