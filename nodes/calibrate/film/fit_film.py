"""Fit a film's model of light and slope, as complex as its presses support.

The model grows part by part, then by harmonics, each judged on held-out balls
(`_film_search`).

Long because its search decides in steps: on parts, samples, harmonics and bad balls.
"""

import math
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tactograph.graph import NodeCall, Port, SizeLimit, node
from tactograph.nodes import (
    F4,
    MIN_CAMERA_MM,
    Film,
    Light,
    LightPlaces,
    LightPositions,
    Metrics,
    Misfit,
    Noise,
    PixelSize,
    robust_deviation,
)
from tactograph.nodes.calibrate import BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.ball.balls_on_film import Balls
from tactograph.nodes.calibrate.film._film_search import Model, Trial, choose
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.calibrate.film.film_fit import Fitting
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.light.film_bounce import DEFAULT_CELLS, film_bounce
from tactograph.nodes.optics.film import FilmPart
from tactograph.nodes.optics.radiosity import cell_grid
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetLight, SheetMask

MIN_CONTACT_CELLS = 4
"""Contact radius in cells from which `film_bounce` resolves how a ball lights the film beside it.
On coarser cells its albedo would absorb residuals of other parts of the model."""


class FilmFit(NamedTuple):
    """LEDs, film and camera, how well the model fits the presses, and what it was fitted to."""

    film: Film
    misfit: Misfit
    residual: Annotated[F4, Port("K", "1")]
    quality: Metrics
    evidence: FilmEvidence


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def fit_film(
    light: SheetLight,
    flat: Light,
    circle: BallCircles,
    radius: BallRadii,
    of: BallPress,
    selection: Annotated[NDArray[np.uint8], Port("P", "flag", high=1)],
    lights: LightPositions,
    strength: Annotated[F4, Port("K", "1")],
    other_lights: LightPlaces,
    noise: Noise,
    pixel: PixelSize,
    bare: SheetMask | None = None,
    shape: RestShape | None = None,
    *,
    camera_mm: Annotated[float, Ge(MIN_CAMERA_MM)] | None = None,
    without: tuple[FilmPart, ...] = (),
    bounce: NodeCall = film_bounce,
) -> FilmFit:
    """Fit equation F1 (`optics/film`) to balls, with those of its parts that the presses support.

    The fit starts from the LEDs placed for a matt film.  Then parts are added one by one: diffuse
    light with a gain of touched film, a glossy coat, light that bounces from film to film, a pupil
    near the film.  Each time, the part that explains the presses best is taken if the film is
    likelier with it, given how usual its values are, and if it lowers the error of held-out balls
    by more than a standard error (`Odds.pays`).  Harmonics come last, of the highest degree in
    position that lowers the error further.  With a single ball, quarters of it are held out
    instead.  No part is tried where a model that leaves noise alone would gain too little.  If the
    film at rest departs by more than light does by itself, all is repeated with LEDs that need not
    face the film's middle.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest; uniform where there was none
    circle, radius, of : B x 3 in px, B in mm, and the press that each ball is in
    selection : 1 for each of the P presses that is used
    lights, strength, other_lights
        K x 3 in mm, K and 8 x K x 3 in mm, as `calibrate_lights` returns them.
    noise : (shot, read), a captured light I has the variance shot * I + read
    pixel : mm per px
    bare : S x W on the sheet, 0 where a marker covers the film: such pixels are left out
    shape
        The film at rest if it is no plane.  Then the pupil is where `shape` has it, the film ends
        with the frame, and there are no harmonics, which would take its shape for light.
    camera_mm : height of the pupil above the film, if known
    without
        Parts that are not tried: ``aim``, ``diffuse``, ``lobe``, ``bounce``, ``camera``,
        ``harmonics``.

    Returns
    -------
    FilmFit
        The `Film`, with LED positions sampled from the uncertainty of the fit; its errors on
        held-out samples, as a `Misfit`; the standard deviation of each LED's residual light, K;
        the figures: ``film_heldout_deg/...`` for each model tried and ``film_heldout_deg`` of
        the one chosen, in degrees between normals; and the inputs, for `judge_radius`.
    """
    inputs = light, flat, circle, radius, of, selection, lights, strength, noise, pixel, shape
    evidence = FilmEvidence(*inputs)
    used = evidence.used()

    def samples(film: Film, **options: Any) -> Balls:
        return used.sample(film, bare=bare, bounce=bounce, **options)

    # A matt film throws no light onto itself, and is sampled again where it may be another.
    balls = samples(Film.matt(lights), fine=True)
    closed: set[str] = set(without) | ({"camera", "harmonics"} if shape is not None else set())
    rest = used.rest(None if "bounce" in closed else bounce)
    trial = Trial(balls, rest, samples, {})
    start = used.start()
    start = start._replace(film=start.film._replace(camera=1 / (camera_mm or math.inf)))
    if camera_mm is not None or len(balls.rim) < 2:
        closed.add("camera")
    cell = cell_grid(flat.shape[1:], pixel, DEFAULT_CELLS, 0).factor * pixel
    if np.median(balls.rim) < MIN_CONTACT_CELLS * cell:
        closed.add("bounce")
    best, balls, folds = choose(trial, start, {*get_args(FilmPart)} - closed)
    sure = Fitting.of(balls, rest, best.parts).certainty(best.fitted)
    hidden: dict[str, Any] = {name: 0.0 for name in ("wrap", "emission") if not sure.shows(name)}
    # Film that is no plane ends with the frame.
    film = best.fitted.film._replace(**hidden | ({} if shape is None else {"rim": 0.0}))
    plain = not best.parts and best.degree is None and camera_mm is None
    if plain and not film.emission:
        # A matt film under points keeps the LED positions that were fitted to all pixels.
        film = film._replace(lights=lights)
    else:
        other_lights = sure.other_places()
    film = film._replace(other_lights=other_lights)
    residual = balls.light - best.fitted.predicted(balls)
    held_out = evidence.held_out(folds)
    uneven = held_out.unevenness()
    if len(balls.centre) == 1 and "diffuse" in best.parts:
        # One ball does not tell by how much the gain of touched film varies.
        uneven = max(uneven, start.film.uneven)
    rough, slope = balls.grain(residual, flat, noise), balls.pressed_slope
    return FilmFit(
        film.stored()._replace(uneven=uneven, grain=rough, pressed_slope=slope),
        misfit=held_out.misfit(film, uneven),
        residual=np.asarray(robust_deviation(residual, axis=1), np.float32),
        quality=trial.figures | _properties(best, film, rest),
        evidence=evidence,
    )


def _properties(best: Model, film: Film, rest: Rest | None) -> Metrics:
    """Figures: the light left over, and properties of the sensor for which the model has a part."""
    figures: Metrics = {"film_heldout_deg": best.error}
    figures["led_emission"] = best.fitted.film.emission
    if film.aim:
        figures["led_aim"] = film.aim
    if film.diffuse.any():
        figures["diffuse_percent"] = float(100 * film.diffuse.mean())
        figures["touched_gain"] = film.gain
        figures["soft_terminator"] = film.wrap
    if film.refraction > 1:
        figures["coat_roughness"], figures["coat_index"] = film.roughness, film.refraction
    if film.albedo > 0:
        figures["film_albedo"], figures["film_rim_mm"] = film.albedo, film.rim
    if film.camera > 0:
        figures["camera_mm"] = 1 / film.camera
    figures["film_residual_percent"] = 100 * best.fitted.scale
    if rest is not None:
        figures["flat_residual_percent"] = 100 * best.fitted.left_at_rest(rest)
    return figures
