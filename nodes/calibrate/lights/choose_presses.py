"""Leave out the presses that are inconsistent with the others, and say why.

Long because each reason has its own test and sentence.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import F4, F8, U1, Light, PixelSize
from tactograph.nodes.calibrate import BallCircles, BallPress
from tactograph.nodes.calibrate.film.judge_radius import ONLY_WARN_ADVICE
from tactograph.nodes.calibrate.lights.light_fit import LedFit, residual_of, shift_of
from tactograph.nodes.calibrate.lights.light_samples import (
    DIM_LIGHT,
    MAX_SAMPLES_EACH,
    Object,
    Rest,
    presses_of,
    unreached,
)
from tactograph.nodes.calibrate.lights.other_press import (
    CELL_PX,
    far_cells,
    film_beside,
    other_press,
    same_press,
)
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.light_noise import SATURATED_LIGHT
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import (
    SheetHeight,
    SheetLabels,
    SheetLight,
    SheetMask,
    SheetSlope,
    cut,
)

MAX_SATURATED_SHARE, MAX_LOST_SHARE = 0.02, 0.5
"""Share of saturated pixels in a contact above which they are left out: fewer are outliers of the
fits, as dirt is. Share above which the press is rejected: most of it is lost."""
CANDIDATE_PRESSES = 8
"""Number of presses that each serve alone as a candidate reference for the others."""
MAX_MEDIANS = 3.0
"""Residual or movement, relative to the median press's, above which a press is an outlier."""
INLIER_RESIDUAL = 0.02
"""Residual, relative to the film at rest, up to which a press is never an outlier."""
INLIER_MOVEMENT_PX = 1.0
"""Movement in px between LEDs up to which a press is never an outlier."""
MAX_RESIDUAL_SHARE = 0.3
"""Largest share of the squared residual that may remain if movement is the cause."""


class ChosenPresses(NamedTuple):
    """The known pixels of the used presses, which presses are used, and their residuals."""

    mask: SheetMask
    bare: SheetMask | None
    """0 where a marker covers the film or a highlight saturates a used press; None: nowhere."""
    selection: Annotated[U1, Port("P", "flag", high=1)]
    residual: Annotated[F4, Port("P", "1")]


@node
def choose_presses(
    image: SheetLight,
    light: SheetLight,
    flat: Light,
    slope: SheetSlope,
    mask: SheetMask,
    height: SheetHeight,
    lit: SheetLabels,
    pixel: PixelSize,
    names: list[str],
    circle: BallCircles,
    of: BallPress,
    shape: RestShape | None = None,
    bare: SheetMask | None = None,
    *,
    only_warn: bool = False,
) -> ChosenPresses:
    """Leave out the pixels of presses that are inconsistent with the others.

    Saturated pixels, as of highlights, are left out where they are more than 2 % of a contact.
    A press is left out, with a warning that gives the reason, if half of it is saturated, if two
    of its images show one light, if its images are in another order than the flat frame's, if an
    LED does not reach it, or if its light contradicts the LED positions found from the others.
    Consensus (Fischler and Bolles, 1981) finds these: LEDs are placed by the flat frame and
    one press at a time, and the placement with the smallest median residual is taken.  A press
    is an outlier if its residual exceeds three times the median press's and 2 % of the light.
    A single press is always kept.

    Parameters
    ----------
    image, light : K x S x W, the presses as captured and relative to the film at rest
    flat : K x H x W, the film at rest
    slope, mask, height, lit
        2 x S x W, S x W, S x W in mm, S x W: of the presses, as for `calibrate_lights`.
    pixel : mm per px
    names : the presses' names, for messages
    circle, of : the balls, as for `rate_exposure`
    shape : the film at rest if it is no plane
    bare : S x W, 0 where a marker covers the film; None: nowhere
    only_warn : whether to use presses whose images are alike or in another order, too

    Returns
    -------
    Mask S x W, empty where a press is left out; `bare` without saturated pixels; 1 for each of the
    P presses that is used; root mean square residual of the light of each press (0 for a single
    press, and for presses that were not compared).

    Raises
    ------
    InputError
        If no press can be used, or the images of all are alike or in another order.
    """
    rows = flat.shape[1]
    pressed = [i for i, bared in enumerate(cut(mask, rows)) if bared.any()]
    lost, spoilt = _saturated(image, mask, rows)
    if spoilt.any():
        bare = np.asarray(~spoilt if bare is None else ~spoilt & (bare > 0), np.uint8)
    bared = mask if bare is None else mask * bare
    presses = presses_of(light, slope, bared, height, lit, rows)
    is_used, residual = np.zeros(len(presses), np.uint8), np.zeros(len(presses), np.float32)
    is_used[pressed] = 1
    why = {
        i: f"{lost[i]:.0%} of its contact is saturated; expose shorter"
        for i in pressed
        if lost[i] > MAX_LOST_SHARE
    }
    if len(presses) == 1 and why:
        raise InputError(why[0].replace("its contact", "the ball"))
    if not only_warn:
        due = coarsen(flat, factor=CELL_PX)
        beside = {i: film_beside(presses[i].light, circle[of == i]) for i in pressed}
        shown = cut(image, rows)
        other = {
            i: same_press(coarsen(shown[i], factor=CELL_PX), far_cells(presses[i].mask > 0))
            or other_press(coarsen(presses[i].light, factor=CELL_PX), due, far_cells(free))
            for i, free in beside.items()
        }
        if other and all(other.values()):
            raise InputError(other[pressed[0]] + ONLY_WARN_ADVICE)
        why = {i: reason for i, reason in other.items() if reason} | why
    if len(presses) > 1:
        judged = [i for i in pressed if i not in why]
        objects = {i: presses[i].samples(pixel, MAX_SAMPLES_EACH, shape) for i in judged}
        why |= {i: few for i in judged if (few := unreached([objects[i]], "its contact"))}
        usable = [i for i in pressed if i not in why]
        if not usable:
            raise InputError(
                f"none of {len(presses)} presses can be used: "
                + "; ".join(f"{names[i]}: {reason}" for i, reason in why.items())
            )
        agreed = _consensus(
            [objects[i] for i in usable], Rest.of(flat, pixel, shape), pixel * light.shape[2]
        )
        residual[usable] = agreed.residual
        why |= {usable[i]: reason for i, reason in _out_of_line(agreed)}
        for i in sorted(why):
            warn(f"press {names[i]} is left out: {why[i]}")
            is_used[i] = 0
    return ChosenPresses(np.repeat(is_used, rows)[:, None] * bared, bare, is_used, residual)


class _Agreement(NamedTuple):
    """The fit of LEDs to each press: its residual, and the ball's movement between LEDs."""

    residual: F8
    moved: F8


def _saturated(image: F4, mask: U1, rows: int) -> tuple[list[float], NDArray[np.bool_]]:
    """The share of each contact that is saturated, and the pixels where that is too much."""
    full = np.any(image >= SATURATED_LIGHT, axis=0)
    lost = [
        float(f[inside > 0].mean()) if inside.any() else 0.0
        for f, inside in zip(cut(full, rows), cut(mask, rows), strict=True)
    ]
    return lost, full & np.repeat(np.array(lost) > MAX_SATURATED_SHARE, rows)[:, None]


def _consensus(objects: list[Object], rest: Rest | None, width_mm: float) -> _Agreement:
    """The fit to each press of the LEDs that most presses agree on."""
    candidates = np.unique(np.linspace(0, len(objects) - 1, CANDIDATE_PRESSES).astype(int))
    alone = [LedFit.of([objects[i]], rest, width_mm) for i in candidates]
    explanations = [_explain(objects, placed) for placed in alone]
    # `_middle` is the lower median: of two presses, the one that explains itself better counts.
    best = min(range(len(alone)), key=lambda i: _middle(explanations[i].residual))
    far = _far(explanations[best].residual, INLIER_RESIDUAL)
    good = [press for press, bad in zip(objects, far, strict=True) if not bad]
    return _explain(objects, LedFit.of(good, rest, width_mm, alone[best]))


def _explain(objects: list[Object], placed: LedFit) -> _Agreement:
    residuals, moved = [], []
    for press in objects:
        shift = shift_of(press, placed)
        error = residual_of(press, placed.leds, shift, placed.flat)
        residuals.append(np.sqrt((error * error).sum() / press.lit.sum()))
        moved.append(_movement(press, placed, shift, error))
    return _Agreement(np.array(residuals), np.array(moved))


def _movement(press: Object, placed: LedFit, shift: F8, error: F8) -> float:
    """The largest distance in px between the object's positions under two LEDs.

    Zero unless a separate position for each LED explains most of the residual.
    """
    step = 0.25
    slopes = [
        (residual_of(press, placed.leds, shift + by, placed.flat) - error) / step
        for by in step * np.eye(2, 3)
    ]
    used_leds, squares = [], 0.0
    for k, lit in enumerate(press.lit):
        used = lit & (press.light[k] > 2 * DIM_LIGHT)
        by_shift = np.stack([s[k, used] for s in slopes], axis=1)
        place = np.linalg.lstsq(by_shift, -error[k, used], rcond=None)[0]
        used_leds.append(place)
        squares += float(((by_shift @ place + error[k, used]) ** 2).sum())
    if squares > MAX_RESIDUAL_SHARE * float((error * error).sum()):
        return 0.0
    apart = np.asarray(used_leds)[:, None] - np.asarray(used_leds)[None]
    return float(np.hypot(apart[..., 0], apart[..., 1]).max())


def _middle(values: F8) -> float:
    return float(np.sort(values)[(values.size - 1) // 2])


def _far(values: F8, harmless: float) -> NDArray[np.bool_]:
    return np.asarray(values > max(MAX_MEDIANS * _middle(values), harmless))


def _out_of_line(agreement: _Agreement) -> Iterator[tuple[int, str]]:
    moved = _far(agreement.moved, INLIER_MOVEMENT_PX)
    for i in np.flatnonzero(_far(agreement.residual, INLIER_RESIDUAL) | moved).tolist():
        if moved[i]:
            yield i, f"the ball moved by {agreement.moved[i]:.1f} px between two LEDs"
        else:
            residual, others = agreement.residual[i], _middle(agreement.residual)
            explained = f"LEDs that explain the others' light to {others:.1%} leave {residual:.1%}"
            yield i, f"{explained} of its; is its radius right?"
