"""Find LEDs and film from presses of rigid objects whose shapes nobody knows.

Near LEDs give a film its light and its fall-off at rest.  Under right LEDs the normals of all
pixels are of length 1 and integrate to a height; under wrong ones they do neither.

Long because light, heights and what must hold of them are one system of equations.
"""

import math
from functools import partial
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from tactograph.sdk import (
    F8,
    Film,
    FilmEvidence,
    InputError,
    Light,
    Misfit,
    NodeCall,
    PixelSize,
    ScaleError,
    SheetLight,
    SizeLimit,
    image_places,
    node,
)
from tactograph.sdk.nodes import film_bounce, film_light, integrate_dct

CELLS_ACROSS = 40
"""Cells along the image: twenty unknowns need no more."""
DIM_LIGHT, DIM_WIDTH = 0.2, 0.03
"""Light of an LED below which it may be in shadow, and over what light its weight grows."""
LIGHT_ERROR, SLOPE_ERROR, FLAT_ERROR = 0.01, 0.02, 0.02
"""Standard deviations of light, of a normal's length and of slopes, and of the flat frame."""
FIRST_SLANT = 0.65
"""Tangent of an LED's slant from which the search starts."""
MAX_SLOPE, MIN_RISE = 3.0, 0.05
"""Steepest slope, and least n_z."""
FIRST_ROUNDS, LATER_ROUNDS = 8, 4
"""Rounds in which heights and the light from film to film are found, at first and later."""
MAX_TURNS, MAX_STEPS, MAX_CHANGE = 14, 4, 0.03
"""Most turns of heights and LEDs, steps of each, and the change, in units, that ends them."""
INDEPENDENT_SAMPLES = 200
"""Most independent samples that a press counts as, because what a model leaves is smooth."""
DOUBTFUL_SCALE = 0.03
"""Relative error of the heights' scale from which it is doubted."""
DERIVATIVE_STEP = 1e-3
"""Relative step of derivatives, above what heights in 32 bits resolve."""
EMISSION_LIMITS = -1.0, 4.0
COAT_LIMITS = {"albedo": (0.0, 0.95), "roughness": (0.08, 0.6), "refraction": (1.3, 1.6)}
"""Of a film with a coat, whose base has the albedo that light from film to film has."""
USUAL_NEARNESS = FilmEvidence.prior("nearness").start
"""Widths of the image over the distance of an LED."""
SHARED_PRIORS = tuple(FilmEvidence.prior(name) for name in ("emission", *COAT_LIMITS))
"""What all LEDs share: m, of an LED that emits as cos^m, and the coat."""


class FilmOfObjects(NamedTuple):
    """LEDs and film, the errors of the model, and what speaks against them."""

    film: Film
    misfit: Misfit
    scale_error: ScaleError
    quality: dict[str, float]
    doubts: list[str]


class _State(NamedTuple):
    """A press: height in mm, slopes 2 x H x W, and the light from film to film, K x H x W."""

    height: F8
    slope: F8
    bounced: F8


class _Scene:
    """Presses relative to the film at rest in cells, K x h x w each, and what is known."""

    def __init__(
        self,
        presses: list[F8],
        evidence: FilmEvidence,
        pixel: float,
        camera: float,
        bounce: NodeCall,
    ) -> None:
        rest = evidence.rest()
        if rest is None:
            raise InputError("`flat` is needed: the untouched film's light tells how far LEDs are")
        self.presses, self.rest, self.matt = presses, rest, evidence.start()
        self.pixel, self.camera, self.bounce = pixel, camera, bounce

    @property
    def places(self) -> tuple[F8, F8]:
        """u, 1 x w, and v, h x 1, in mm."""
        x, y = image_places(self.presses[0].shape[1:], self.pixel)
        return x.astype(float), y.astype(float)

    @property
    def width(self) -> float:
        return self.pixel * self.presses[0].shape[2]


@node(sizes={"K": SizeLimit(4, 8, "three LEDs say nothing of a normal's length")})
def film_of_objects(
    light: SheetLight,
    flat: Light,
    pixel: PixelSize,
    *,
    camera_mm: Annotated[float, Ge(1 / FilmEvidence.prior("camera").high)] | None = None,
    bounce: NodeCall = film_bounce,
) -> FilmOfObjects:
    """Return the LEDs and the film that make one surface of each press.

    In turn: normals by photometric stereo under the present LEDs, heights by integration, with the
    light that a coat mirrors and the film throws on itself taken off; then LEDs, coat and albedo
    by least squares of what normals lack of length 1, slopes of an integrable field, LEDs of one
    normal, and the flat frame of the LEDs' fall-off.  The scale comes from near light alone.

    Parameters
    ----------
    light : K x S x W, presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest, a plane
    pixel : mm per px
    camera_mm : height of the pupil above the film; None: far away

    Returns
    -------
    FilmOfObjects
        A matt film, or one with a coat if that leaves less.  Errors are those of least squares.

    Raises
    ------
    InputError
        If there is no flat frame.
    """
    factor = max(1, round(flat.shape[2] / CELLS_ACROSS))
    sheets = np.split(light, light.shape[1] // flat.shape[1], axis=1)
    presses = [_cells(press, factor) for press in sheets]
    camera = 0.0 if camera_mm is None else 1 / camera_mm
    evidence = FilmEvidence.of_flat(flat, pixel)
    scene = _Scene(presses, evidence, pixel * factor, camera, bounce)
    matt = _solved(scene, _start(scene), coated=False)
    best = min(matt, _coated(scene, matt), key=lambda solved: solved.cost)
    wide = [_cells(press, 2 * factor) for press in sheets]
    wide_scene = _Scene(wide, evidence, pixel * 2 * factor, camera, bounce)
    coarser = _solved(wide_scene, _start(wide_scene), coated=False)
    if best is not matt:
        coarser = _coated(wide_scene, coarser)
    others = [presses[:i] + presses[i + 1 :] for i in range(len(presses))]
    scenes = [_Scene(o, evidence, scene.pixel, camera, bounce) for o in others if o]
    fewer = [_solved(each, best.x, coated=best is not matt) for each in scenes]
    return _stated(scene, best, coarser, fewer)


def _coated(scene: _Scene, matt: OptimizeResult) -> OptimizeResult:
    """The film with a coat, from the matt one."""
    coat = np.r_[matt.x, [usual.start for usual in SHARED_PRIORS[1:]]]
    return _solved(scene, coat, coated=True)


def _cells(press: Light, factor: int) -> F8:
    rows, columns = (side // factor for side in press.shape[1:])
    whole = press[:, : rows * factor, : columns * factor]
    means = [cv2.resize(p, (columns, rows), interpolation=cv2.INTER_AREA) for p in whole]
    return np.stack(means).astype(np.float64)


def _start(scene: _Scene) -> F8:
    """LEDs where the flat frame grows brighter, at a usual slant and distance; no emission."""
    rest = scene.rest
    plane = np.stack([rest.x, rest.y, np.ones_like(rest.x)], axis=1)
    grows = np.linalg.lstsq(plane, rest.logarithm.T, rcond=None)[0][:2].T
    ways = FIRST_SLANT * grows / np.linalg.norm(grows, axis=1, keepdims=True)
    nearness = np.full(len(ways), USUAL_NEARNESS / scene.width)
    return np.r_[np.column_stack([ways, nearness]).ravel(), SHARED_PRIORS[0].start]


def _units(scene: _Scene, unknowns: F8) -> F8:
    """How far an unknown is expected to move."""
    leds = np.tile([0.1, 0.1, USUAL_NEARNESS / scene.width / 2], len(scene.presses[0]))
    return np.r_[leds, [usual.spread for usual in SHARED_PRIORS]][: unknowns.size]


def _leds(scene: _Scene, unknowns: F8) -> F8:
    """LEDs as of a fit, K x 4.  Strengths are what the LEDs leave of the flat frame in the mean."""
    count = len(scene.presses[0])
    return np.c_[unknowns[: 3 * count].reshape(count, 3), np.zeros(count)]


def _film(scene: _Scene, unknowns: F8) -> Film:
    emission, *coat = unknowns[3 * len(scene.presses[0]) :].tolist()
    lights = scene.matt.with_leds(_leds(scene, unknowns)).film.lights.astype(np.float32)
    film = Film.matt(lights)._replace(camera=scene.camera, emission=emission)
    if coat:
        film = film._replace(base=coat[0], **dict(zip(COAT_LIMITS, coat, strict=True)))
    return film


def _solved(scene: _Scene, unknowns: F8, *, coated: bool) -> OptimizeResult:
    """Heights and LEDs in turn."""
    units = _units(scene, unknowns)
    limits = [EMISSION_LIMITS, *COAT_LIMITS.values()] if coated else [EMISSION_LIMITS]
    free, (low, high) = np.full(unknowns.size - len(limits), np.inf), np.transpose(limits)
    bounds = np.r_[-free, low], np.r_[free, high]
    nothing = [_State(0 * p[0], 0 * p[:2], 0 * p) for p in scene.presses]
    states, rounds = nothing, FIRST_ROUNDS
    for _ in range(MAX_TURNS):
        film = _film(scene, unknowns)
        states = [
            _raised(scene, press, state, film, rounds)
            for press, state in zip(scene.presses, states, strict=True)
        ]
        solved = least_squares(
            partial(_residuals, scene), unknowns, args=(states,), loss="soft_l1", x_scale=units,
            bounds=bounds, max_nfev=MAX_STEPS, diff_step=np.full(unknowns.size, DERIVATIVE_STEP),
        )  # fmt: skip
        change, unknowns = np.abs((solved.x - unknowns) / units).max(), solved.x
        rounds = LATER_ROUNDS
        if change < MAX_CHANGE:
            break
    return solved


def _beams(scene: _Scene, film: Film, z: F8) -> F8:
    """The light of level film at heights over that under LEDs that emit alike everywhere."""
    alike = Film.matt(film.lights)._replace(camera=scene.camera)
    films = alike._replace(emission=film.emission, aim=film.aim), alike
    level, apparent = np.zeros((2, *z.shape)), z / (1 - scene.camera * z)
    emitting, plain = (film_light(level, apparent, each, scene.pixel) for each in films)
    return np.asarray(emitting / plain, float)


def _vectors(scene: _Scene, film: Film, z: F8) -> F8:
    """v of equation N1 where the camera's rays meet the film: K x 3 x h x w."""
    u, v = scene.places
    nearer, vectors = 1 - scene.camera * z, []
    for (lx, ly, lz), beam in zip(film.lights.astype(float), _beams(scene, film, z), strict=True):
        away = np.stack([lx - u * nearer, ly - v * nearer, lz - z])
        ratio = ((lx - u) ** 2 + (ly - v) ** 2 + lz**2) / np.square(away).sum(axis=0)
        vectors.append(away / lz * ratio * np.sqrt(ratio) * beam)
    return np.stack(vectors)


def _matt(scene: _Scene, press: F8, state: _State, film: Film, vectors: F8) -> F8:
    """The light that a matt film would have: without bounces, and what a coat makes of it."""
    if film.refraction == 1:
        return press
    p, q = state.slope
    n = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    apparent = state.height / (1 - scene.camera * state.height)
    light = film_light(state.slope, apparent, film, scene.pixel)
    direct = np.einsum("kihw,ihw->khw", vectors, n)
    return np.asarray(press - film.albedo * state.bounced - (light - direct))


def _normals(matt: F8, press: F8, vectors: F8) -> tuple[F8, F8]:
    """Normals of any length, 3 x h x w, by the LEDs that are bright, and what these leave."""
    weight = 1 / (1 + np.exp((DIM_LIGHT - press) / DIM_WIDTH))
    square = np.einsum("kihw,kjhw,khw->hwij", vectors, vectors, weight) + 1e-6 * np.eye(3)
    right = np.einsum("kihw,khw->hwi", vectors, weight * matt)
    n = np.linalg.solve(square, right[..., None])[..., 0].transpose(2, 0, 1)
    return n, weight * (matt - np.einsum("kihw,ihw->khw", vectors, n))


def _height(scene: _Scene, n: F8) -> tuple[F8, F8]:
    """The height, 0 at the border, and the slopes of normals."""
    slope = np.clip(-n[:2] / np.maximum(n[2], MIN_RISE), -MAX_SLOPE, MAX_SLOPE)
    z = integrate_dct(slope.astype(np.float32), np.float32(scene.pixel)).astype(np.float64)
    return z - np.median(np.concatenate([z[0], z[-1], z[:, 0], z[:, -1]])), slope


def _raised(scene: _Scene, press: F8, state: _State, film: Film, rounds: int) -> _State:
    """The height of a press under known LEDs."""
    for _ in range(rounds):
        vectors = _vectors(scene, film, state.height)
        n, _ = _normals(_matt(scene, press, state, film, vectors), press, vectors)
        z, slope = _height(scene, n)
        # Half way to the height's own slopes: a coat's light under spoilt ones is far off.
        down, right = np.gradient(z, scene.pixel)
        slope = (slope + np.stack([right, down])) / 2
        state = _State(z, slope, (state.bounced + _bounced(scene, press, z, film)) / 2)
    return state


def _bounced(scene: _Scene, press: F8, z: F8, film: Film) -> F8:
    """The light from film to film, for an albedo of 1."""
    if film.albedo == 0:
        return np.zeros_like(press)
    apparent = (z / (1 - scene.camera * z)).astype(np.float32)
    light = scene.bounce(press.astype(np.float32), apparent, film.stored(), np.float32(scene.pixel))
    return np.asarray(light, np.float64) / film.albedo


def _residuals(scene: _Scene, unknowns: F8, states: list[_State]) -> F8:
    """What LEDs and film leave unexplained, in standard deviations."""
    film, count = _film(scene, unknowns), len(scene.presses[0])
    shared = unknowns[3 * count :]
    about = [usual.start for usual in SHARED_PRIORS][: shared.size]
    usual = USUAL_NEARNESS / scene.width
    fit = scene.matt._replace(leds=_leds(scene, unknowns), film=film)
    at_rest = fit.rest_residual(scene.rest)
    parts = [
        (unknowns[2 : 3 * count : 3] - usual) / usual,
        (shared - about) / _units(scene, unknowns)[3 * count :],
        (at_rest - at_rest.mean(axis=1, keepdims=True)).ravel() / FLAT_ERROR,
    ]
    for press, state in zip(scene.presses, states, strict=True):
        vectors = _vectors(scene, film, state.height)
        n, residual = _normals(_matt(scene, press, state, film, vectors), press, vectors)
        z, (p, q) = _height(scene, n)
        length = np.sqrt(np.square(n).sum(axis=0)) - 1
        parts += [residual.ravel() / LIGHT_ERROR, length.ravel() / LIGHT_ERROR]
        parts += [
            ((p[:, 1:] + p[:, :-1]) / 2 - np.diff(z, axis=1) / scene.pixel).ravel() / SLOPE_ERROR,
            ((q[1:] + q[:-1]) / 2 - np.diff(z, axis=0) / scene.pixel).ravel() / SLOPE_ERROR,
        ]
    return np.concatenate(parts)


def doubts_of_emission(emission: float) -> list[str]:
    """A doubt if the LEDs' emission is at a limit: no value was found, and the scale makes up."""
    return [
        f"the LEDs seem to emit as the cosine to the power of {emission:.2g}, which is the limit: "
        "no film that is modelled here explains presses and flat frame; calibrate with a ball"
    ] * any(math.isclose(emission, limit, abs_tol=DERIVATIVE_STEP) for limit in EMISSION_LIMITS)


def _stated(
    scene: _Scene, solved: OptimizeResult, coarser: OptimizeResult, fewer: list[OptimizeResult]
) -> FilmOfObjects:
    """The film, and how well it is known.

    The scale's variance is that of least squares, that of leaving out each press (the jackknife),
    and the square of a third of the change on cells twice as large (Richardson, second order).
    """
    film, count = _film(scene, solved.x), len(scene.presses[0])
    independent = count * INDEPENDENT_SAMPLES * len(scene.presses)
    variance = 2 * solved.cost / solved.fun.size * max(1, solved.fun.size / independent)
    spread = variance * np.linalg.pinv(solved.jac.T @ solved.jac, hermitian=True)
    leds, spread = _leds(scene, solved.x), spread[: 3 * count, : 3 * count]
    others = scene.matt.with_leds(leds).other_places(spread, scene.width)
    steeper: NDArray[np.float64] = np.zeros((count, 3))
    steeper[:, :2] = leds[:, :2] / np.square(leds[:, :2]).sum(axis=1, keepdims=True) / count
    by_scale = steeper.ravel()
    moved = [by_scale @ (other.x - solved.x)[: 3 * count] for other in (coarser, *fewer)]
    cells, *left_out = np.square(moved) * ([1 / 9] + len(fewer) * [1 - 1 / max(1, len(fewer))])
    scale = math.sqrt(float(by_scale @ spread @ by_scale + cells + sum(left_out)))
    level = math.sqrt(variance) * SLOPE_ERROR / math.sqrt(max(1, solved.fun.size / independent))
    doubts = [
        f"presses and flat frame leave {scale:.0%} of the heights' scale open: press other "
        "objects, steep and at other places, or calibrate with a ball"
    ] * (scale > DOUBTFUL_SCALE) + doubts_of_emission(film.emission)
    figures = {"scale_error_percent": 100 * scale, "led_emission": film.emission}
    if film.refraction > 1:
        figures |= {"film_albedo": film.albedo, "coat_roughness": film.roughness}
        figures |= {"coat_index": film.refraction}
    bounce = FilmEvidence.prior("bounced").spread
    misfit = np.array([level, 4 * scene.pixel, LIGHT_ERROR, bounce, 0], np.float32)
    film = film.stored()._replace(other_lights=others)
    return FilmOfObjects(film, misfit, scale, figures, doubts)
