"""Samples of balls pressed into a film, to which a film's model is fitted.

Long because a sample holds the light that its film throws on itself, on a film of any shape.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import NodeCall, Port
from tactograph.nodes import F4, F8, U1, Film, Light, LightPositions, Noise, PixelSize
from tactograph.nodes.calibrate import (
    FOLD_COUNT,
    MAX_LED_WIDTHS,
    MAX_SAMPLE_SLOPE,
    SHIFT_DEVIATION_PX,
    BallCircles,
    BallPress,
    BallRadii,
)
from tactograph.nodes.calibrate.ball.ball_surface import (
    MAX_SQUARED_RADIUS,
    away_on,
    ball_height,
    sunk,
)
from tactograph.nodes.calibrate.ball.balls_on_film import (
    MAX_INDEPENDENT_SAMPLES,
    Balls,
    Beneath,
    Fitted,
)
from tactograph.nodes.calibrate.ball.level_touches import press_drift
from tactograph.nodes.calibrate.film._contact_edge import MAX_EDGE_RATIO, contact_edge
from tactograph.nodes.calibrate.film.film_misfit import Held
from tactograph.nodes.calibrate.film.film_unknowns import SHARED_UNKNOWNS, USUAL_ALBEDO, Unknown
from tactograph.nodes.calibrate.lights.descend import least_squares
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.calibrate.rest.rest_light import rest_light
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_bounce import DEFAULT_CELLS, film_bounce
from tactograph.nodes.light.film_drift import drift_gain
from tactograph.nodes.light.light_noise import rest_noise
from tactograph.nodes.light.untouched_film import light_at_rest
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT, RestShape
from tactograph.nodes.optics.sheet import SheetLight, cut

FITTED_RADIUS_SHARE = 0.95
"""Share of a contact's radius that is fitted, because the film leaves the ball before the rim."""
FINE_CELLS = 4 * DEFAULT_CELLS
"""Cells of `film_bounce` on a matt film, and in the last fit on one with a coat, which takes seven
times as long.  With coarser cells the light changes in steps with a ball's height or the rim."""
LIFT_SHARE = 0.02
"""Share of a ball's radius by which it is lifted, to differentiate a bounce by its height."""
BOUNCED_ALBEDO, RIM_STEP_MM = USUAL_ALBEDO.start, SHARED_UNKNOWNS["rim"].spread
"""Albedo of the film for which a bounce is computed, and mm by which the film is widened, to
differentiate it by the film's rim."""


class _Press(NamedTuple):
    """A press, K x H x W, and the light that its film reflects onto itself.

    `bounced` is that of a film of albedo 1.  `by_lift` is its derivative by the balls' height,
    `by_rim` that by the film's rim, both per mm.
    """

    light: F4
    bounced: F4
    by_lift: F4
    by_rim: F4


class _AtRest(NamedTuple):
    """Light of the film at rest over a plane, K x H x W each, or of a plane.

    That of the LEDs, and from film to film for an albedo of 1.
    """

    own: F4 = np.ones((1, 1, 1), np.float32)
    bounced: F4 = np.zeros((1, 1, 1), np.float32)

    def share(self, albedo: float | np.float32) -> F4:
        """Return r of equation F5."""
        share = self.own + np.float32(albedo) * self.bounced
        return np.maximum(share, np.float32(MIN_REST_LIGHT))


class _Frame(NamedTuple):
    """An image of H x W pixels, mm per px, and the film at rest if it is no plane."""

    size: tuple[int, int]
    pixel: float
    shape: RestShape | None

    def place(self, row: Any, column: Any) -> tuple[F8, F8]:
        """Places of pixels, u and v in mm."""
        rows, columns = self.size
        u, v = np.asarray(column, np.float64), np.asarray(row, np.float64)
        return (u - (columns - 1) / 2) * self.pixel, (v - (rows - 1) / 2) * self.pixel

    def around(self, circle: F4 | F8, reach: float) -> NDArray[np.intp]:
        """Rows and columns, 2 x N, of a square around a circle, `reach` in px to either side."""
        if self.shape is not None:
            # A contact may reach anywhere.
            reach = max(self.size)
        row, column = (
            slice(max(0, int(at - reach)), min(side, int(at + reach) + 2))
            for at, side in zip(circle[1::-1].tolist(), self.size, strict=True)
        )
        return np.asarray(np.mgrid[row, column].reshape(2, -1))

    def beneath(self, circle: F4 | F8) -> tuple[F8, F8, F8]:
        """Where the camera sees the film at rest in the middles of balls: x, y and z in mm."""
        column, row = np.atleast_2d(circle)[:, :2].T
        u, v = self.place(row, column)
        return (u, v, np.zeros_like(u)) if self.shape is None else self.shape.at(u, v)[1:]

    def scale(self, circle: F4 | F8) -> F8:
        """The size of a pixel in mm on the film under each ball."""
        camera = 0.0 if self.shape is None else self.shape.camera
        return self.pixel * (1 - camera * self.beneath(circle)[2])

    def centre(self, circle: F4 | F8, radius: float, shift: F8) -> tuple[float, float, float]:
        """A ball's centre in mm, moved by `shift`; it may lie outside the image."""
        x, y, base = (float(part[0]) for part in self.beneath(circle))
        deep = float(sunk(radius, float(circle[2]) * self.scale(circle)[0]) - base)
        return float(x + shift[0]), float(y + shift[1]), float(shift[2] - deep)


class _Placed(NamedTuple):
    """Balls where a fit has them.

    Circles are B x 3 in px, radii B and shifts B x 3 in mm, the presses that they are in B.
    """

    circle: F8
    radius: F4
    shift: F8
    of: BallPress

    def on(self, press: int) -> Self:
        """The balls in one press."""
        return type(self)(*(each[self.of == press] for each in self))


class _Thrown(NamedTuple):
    """Light from film to film, K x H x W, and what `level_touches` leaves of it.

    Balls also brighten the film at rest around them, which `level_touches` takes for drift.
    """

    whole: F4
    remaining: F4


class _Scene(NamedTuple):
    """What the light from film to film depends on beside the balls.

    `sigma` is the noise of cells, `fine` and `bounce` as for `FilmEvidence.sample`, `at_rest` the
    light of the film at rest by its coat's index and the number of cells.
    """

    film: Film
    frame: _Frame
    sigma: F4
    fine: bool
    bounce: NodeCall
    at_rest: Callable[[float, int], _AtRest]

    @property
    def cells(self) -> int:
        """How fine the light from film to film is found that samples get."""
        return FINE_CELLS if self.fine or self.film.refraction == 1 else DEFAULT_CELLS

    @property
    def resting(self) -> _AtRest:
        """The light of the film at rest that samples get."""
        return self.at_rest(self.film.refraction, self.cells)


class FilmEvidence(NamedTuple):
    """What a film is fitted to: presses, film at rest, LEDs as placed for a matt film, and noise.

    The light is K x S x W on a sheet, relative to the film at rest, K x H x W; circles are B x 3 in
    px, radii B in mm, `of` the press that each ball is in; the selection is P, 1 for presses that
    are used; the first lights are K x 3 in mm, their strength K; the noise is that of the camera,
    the pixel in mm; `shape` is the film at rest if it is no plane, which then ends with the frame.
    """

    light: SheetLight
    flat: Light
    circle: BallCircles
    radius: BallRadii
    of: BallPress
    selection: Annotated[NDArray[np.uint8], Port("P", "flag", high=1)]
    first_lights: LightPositions
    strength: Annotated[F4, Port("K", "1")]
    noise: Noise
    pixel: PixelSize
    shape: RestShape | None = None

    @staticmethod
    def prior(name: str) -> Unknown:
        """Return an unknown before any evidence: its usual value, deviation and limits."""
        return Unknown.of(name)

    @staticmethod
    def least_squares(residual: Callable[[F8], F8], start: F8, spread: F8) -> F8:
        """Return the unknowns, of usual `spread`, that leave residuals the least, robustly."""
        return least_squares(residual, start, spread)

    @classmethod
    def of_flat(cls, flat: Light, pixel: float, lights: NDArray[Any] | None = None) -> Self:
        """Return a film at rest without presses, under `lights` if their places are known."""
        placed: Any = np.ones((len(flat), 3)) if lights is None else lights
        balls = np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32)
        strength, noise = np.ones(len(flat), np.float32), np.zeros(2, np.float32)
        press = np.zeros(0, np.uint8)
        return cls(flat[:, :0], flat, *balls, press, placed, strength, noise, pixel)

    def used(self, most: int | None = None) -> Self:
        """Return the evidence of the balls alone that were found, in presses that are used.

        At `most` so many, spread over all.
        """
        used = np.flatnonzero((self.selection[self.of] > 0) & (self.circle[:, 2] > 0))
        used = used[:: 1 if most is None else used.size // most + 1]
        return self._replace(circle=self.circle[used], radius=self.radius[used], of=self.of[used])

    def is_parallel(self, film: Film) -> bool:
        """Return whether an LED of a film is so far that its light is parallel."""
        width = self.pixel * self.flat.shape[2]
        return bool(np.linalg.norm(film.lights, axis=1).max() > MAX_LED_WIDTHS * width)

    def start(self) -> Fitted:
        """Return the matt film under the LEDs as placed, from which a fit starts."""
        return Fitted.matt(self.first_lights, self.strength, len(self.circle))

    def held_out(self, folds: list[tuple[Balls, Fitted]]) -> Held:
        """Return what is known of a film by samples, fold by fold, that its fit had not."""
        return Held(folds, self.pixel)

    def rest(self, bounce: NodeCall | None = None, film: Film | None = None) -> Rest | None:
        """Return the flat frame in blocks; None if none was taken.

        With `bounce` also what a film that is no plane throws on itself; None: a matt film.
        """
        glow = None
        if bounce is not None and self.shape is not None:
            kind = (film or Film.matt(self.first_lights))._replace(rim=0.0)
            glow = _rest_of(self.shape, kind, DEFAULT_CELLS, False, bounce).bounced
        return Rest.of(self.flat, self.pixel, self.shape, glow)

    def sample(
        self,
        film: Film,
        *,
        most: int | None = MAX_INDEPENDENT_SAMPLES,
        bare: U1 | None = None,
        shifts: F8 | None = None,
        rim: F8 | None = None,
        fine: bool = False,
        bounce: NodeCall = film_bounce,
    ) -> Balls:
        """Choose samples of the balls, spread evenly over each.

        Parameters
        ----------
        film : the film, whose LEDs and coat determine the light from film to film
        most : most samples of all balls together, but at least one for each of a
            ball's parts (`Balls.thinned`); None: all pixels
        bare
            S x W, 0 on pixels that are left out.  None: no pixel is left out.
        shifts
            B x 3 in mm, by which a fit has moved the balls; they reflect light from there.  The
            light from film to film grows with the height of their flanks; `by_lift` tells the fit
            how much.
        rim
            B contact radii in mm; None: those of `circle`.  On a film that lights itself, the light
            around a ball then determines where the film leaves it (`contact_edge`).
        fine
            Whether the film is the final one.  Then the light that its coat reflects is computed on
            fine cells, and a film without albedo reflects none onto itself.
        bounce
            `film_bounce`, on a device if there is one.  For a film that does not light itself, a
            few calls on the host take less time than to compile the kernels.
        """
        light, flat, circle, radius, of, *_, pixel, shape = self
        scene = self._scene(film, fine, bounce)
        film, frame, scale = scene.film, scene.frame, scene.frame.scale(circle)
        moved = np.zeros((len(circle), 3)) if shifts is None else shifts
        middle, contact = circle[:, :2], circle[:, 2] if rim is None else rim / scale
        balls = _Placed(np.column_stack([middle, contact]).astype(np.float64), radius, moved, of)
        presses = cut(light, len(flat[0]))
        masks = cut(np.ones(light.shape[1:], np.uint8) if bare is None else bare, len(flat[0]))
        thrown = {i: _thrown_on(presses[i], balls.on(i), scene) for i in np.unique(of)}
        if rim is not None and film.lights_itself:
            edge = _edges(thrown, masks, balls, scene)
            moved = moved_with(moved, radius, balls.circle[:, 2] * scale, edge)
            circles = np.column_stack([middle, edge / scale]).astype(np.float64)
            balls = _Placed(circles, radius, moved, of)
        pixels = _inside(masks, balls, scene)
        values, bounced, by_lift, by_rim = (
            np.concatenate([f[:, *at] for f, at in zip(each, pixels, strict=True)], 1, dtype=float)
            for each in zip(*(thrown[i] for i in of), strict=True)
        )
        ball = np.repeat(np.arange(len(of)), [at.shape[1] for at in pixels])
        row, column = at = np.concatenate(pixels, axis=1)
        u, v = frame.place(row, column)
        x, y = (at[::-1].T - middle[ball]).T
        every = Balls(
            u=u,
            v=v,
            light=values,
            ball=ball,
            centre=np.stack(frame.place(*middle[:, ::-1].T), axis=1),
            rim=balls.circle[:, 2] * scale,
            radius=radius.astype(np.float64),
            bounced=bounced - moved[ball, 2] * by_lift - film.rim * by_rim,
            by_lift=by_lift,
            by_rim=by_rim,
            sector=np.floor(np.arctan2(y, x) / (2 * np.pi) % 1 * FOLD_COUNT).astype(int),
            shift_mm=SHIFT_DEVIATION_PX * pixel,
            width_mm=pixel * frame.size[1],
        )
        if shape is not None:
            glow = scene.resting.bounced[:, row, column].astype(np.float64)
            every = self.laid(every, glow)
        return every if most is None else every.thinned(most)

    def _scene(self, film: Film, fine: bool, bounce: NodeCall) -> _Scene:
        """What the light from film to film depends on, for a film and this frame."""
        flat, shape = self.flat, self.shape
        if shape is not None:
            film = film._replace(rim=0.0)
        throw = bounce if film.lights_itself else film_bounce

        @cache
        def at_rest(refraction: float, cells: int) -> _AtRest:
            kind = film._replace(refraction=refraction)
            return _AtRest() if shape is None else _rest_of(shape, kind, cells, fine, throw)

        # The presses are relative to a model if no flat frame was taken.
        resting = rest_light(flat, self.first_lights, self.strength, self.pixel)
        sigma = coarsen(rest_noise(resting, self.noise))
        frame = _Frame((flat.shape[1], flat.shape[2]), self.pixel, shape)
        return _Scene(film, frame, sigma, fine, throw, at_rest)

    def laid(self, balls: Balls, glow: F8 | None = None) -> Balls:
        """Return balls on film that is no plane at rest; `glow` is what it throws on itself."""
        shape = self.shape
        assert shape is not None  # a plane has nothing beneath
        rows, columns = shape.height.shape
        *under, base = _Frame((rows, columns), shape.pixel, shape).beneath(self.circle)
        if glow is None and balls.beneath is not None:
            glow = balls.beneath.bounced
        assert glow is not None  # known since the balls were laid first
        beneath = Beneath(*shape.at(balls.u, balls.v), glow, base)
        return replace(balls, centre=np.stack(under, axis=1), beneath=beneath)


def moved_with(shifts: F8, radius: NDArray[Any], before: NDArray[Any], rim: NDArray[Any]) -> F8:
    """Return the shifts of balls that stay in place while their contact radii change."""
    moved = shifts.copy()
    moved[:, 2] += sunk(radius, rim) - sunk(radius, before)
    return moved


def _edges(
    thrown: dict[int, _Press], masks: list[U1], balls: _Placed, scene: _Scene
) -> NDArray[Any]:
    """The radii of balls' contacts in mm, from the light around them.

    Film under markers counts as dark, so that `contact_edge` ignores it.
    """
    film, frame, *_ = scene
    edges, share = [], scene.resting.share(film.albedo)
    # Whole frames: once a press, of which each may show dozens of balls.
    on_plane = {i: press.light * share * masks[i] for i, press in thrown.items()}
    for circle, radius, shift, i in zip(*balls, strict=True):
        at = frame.around(circle, MAX_EDGE_RATIO * circle[2])
        u, v = frame.place(*at)
        light = on_plane[i][:, *at].astype(np.float64)
        bounced = (film.albedo * thrown[i].bounced[:, *at]).astype(np.float64)
        beneath = None
        if frame.shape is not None:
            beneath = Beneath(*frame.shape.at(u, v), bounced, frame.beneath(circle)[2])
        rim, centre = float(circle[2] * frame.scale(circle)[0]), frame.centre(circle, radius, shift)
        edges.append(contact_edge(u, v, light, bounced, centre, radius, rim, film, beneath))
    return np.array(edges)


def _inside(masks: list[U1], balls: _Placed, scene: _Scene) -> list[NDArray[np.intp]]:
    """Rows and columns, 2 x N, of the pixels of each ball that are fitted."""
    film, frame, *_ = scene
    pixels, steepest = [], np.sin(np.arctan(MAX_SAMPLE_SLOPE))
    for circle, radius, shift, i in zip(*balls, strict=True):
        mm = frame.scale(circle)[0]
        reach = min(FITTED_RADIUS_SHARE * circle[2], radius / mm * steepest)
        at = frame.around(circle, reach)
        away = np.hypot(*(at[::-1].T - circle[:2]).T) * mm
        if frame.shape is not None:
            u, v = frame.place(*at)
            base, size = float(frame.beneath(circle)[2][0]), float(radius)
            centre = frame.centre(circle, size, shift)
            away = away_on(u, v, frame.shape.at(u, v)[3], base, centre, size, film.camera)
        pixels.append(at[:, (away < reach * mm) & (masks[i][tuple(at)] > 0)])
    return pixels


def _rest_of(shape: RestShape, film: Film, cells: int, fine: bool, bounce: NodeCall) -> _AtRest:
    """The light of the film at rest; what it throws on itself in turn with what falls on it."""
    if film.albedo == 0 and not fine:
        film = film._replace(albedo=BOUNCED_ALBEDO)
    direct, thrown = light_at_rest(shape, film, bounce, cells)
    return _AtRest(direct, thrown / np.float32(film.albedo or 1))


def _thrown_on(press: F4, balls: _Placed, scene: _Scene) -> _Press:
    """The light from film to film on a press with these balls."""
    film, (size, pixel, shape), sigma, fine, bounce, at_rest = scene
    nothing = np.zeros_like(press)
    if fine and film.albedo == 0:
        return _Press(press, nothing, nothing, nothing)
    u, v = scene.frame.place(np.arange(size[0])[:, None], np.arange(size[1]))

    def thrown(film: Film, cells: int, lift: float = 0) -> _Thrown:
        """The light that a film of albedo 1, with the balls in it, reflects onto itself."""
        height = np.zeros(size) if shape is None else shape.height
        resting = at_rest(film.refraction, cells)
        for circle, r, shift, _ in zip(*balls, strict=True):
            cx, cy, cz = scene.frame.centre(circle, r, shift + np.array([0, 0, lift]))
            z = ball_height(u, v, (cx, cy, cz), r, film.camera)
            nearer = 1 - film.camera * z
            away = (u * nearer - cx) ** 2 + (v * nearer - cy) ** 2 + (z - cz) ** 2
            height = np.where(away < MAX_SQUARED_RADIUS * r**2, np.maximum(height, z), height)
        apparent = (height / (1 - film.camera * height)).astype(np.float32)
        on_plane = press * resting.share(film.albedo)
        light = bounce(on_plane, apparent, film._replace(albedo=BOUNCED_ALBEDO), pixel, cells=cells)
        # Balls are not film at rest, although little light is reflected onto their tops.
        around = (resting.own + light) / resting.share(BOUNCED_ALBEDO)
        is_ball = apparent > (0 if shape is None else shape.apparent)
        drift = press_drift(np.where(is_ball, press, around), sigma)
        level = (drift_gain(drift, size) - 1) * on_plane
        whole, removed = light / np.float32(BOUNCED_ALBEDO), level / np.float32(BOUNCED_ALBEDO)
        return _Thrown(whole, whole - removed)

    lift = LIFT_SHARE * float(balls.radius.min())
    wider = film._replace(rim=film.rim + RIM_STEP_MM)
    # A coat changes the amount of light; its growth with a ball's height is taken from matt film.
    matt = film._replace(refraction=1.0)
    rough = FINE_CELLS if film.refraction == 1 else DEFAULT_CELLS
    on_matt = thrown(matt, FINE_CELLS)
    bounced = on_matt if rough == FINE_CELLS else thrown(film, rough)
    more = bounced.remaining.mean() / (on_matt.remaining.mean() or 1) / lift
    by_lift = (thrown(matt, FINE_CELLS, lift).remaining - on_matt.remaining) * np.float32(more)
    by_rim = thrown(wider, rough).remaining - bounced.remaining if shape is None else nothing
    bounced = bounced if rough == scene.cells else thrown(film, scene.cells)
    light = press if film.albedo == 0 else _levelled(press, bounced, scene)
    return _Press(light, bounced.remaining, by_lift, by_rim / np.float32(RIM_STEP_MM))


def _levelled(press: F4, thrown: _Thrown, scene: _Scene) -> F4:
    """Level a press again, with the known light from film to film not taken for drift.

    For a film of this albedo, the press minus the light from film to film then is the LEDs'
    light.  For another albedo, `remaining` accounts for what would have been taken for drift.
    """
    by, sigma, resting = np.float32(scene.film.albedo), scene.sigma, scene.resting
    direct = coarsen(by * (thrown.whole - resting.bounced) / resting.share(by))
    drift = press_drift(press, sigma, direct)
    removed = by * (thrown.whole - thrown.remaining) / resting.share(by)
    return np.asarray(press / drift_gain(drift, press.shape[1:]) - removed, np.float32)
