"""The unknowns of a film's fit: start values, priors, and steps from one fit to another."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F8, Film
from tactograph.nodes.calibrate.ball.balls_on_film import Fitted
from tactograph.nodes.calibrate.lights.descend import DERIVATIVE_STEP
from tactograph.nodes.calibrate.lights.light_fit import INFINITY_MM
from tactograph.nodes.optics.film import matt_film
from tactograph.nodes.stored import stored_values


class Unknown(NamedTuple):
    """A parameter of a usual sensor, where the fit starts, and its standard deviation."""

    start: float
    spread: float


STATED_UNKNOWNS = "size", "power"
"""Unknowns of what was stated, not of the film: the balls' radius and the camera's gamma."""
MATT_FILM = matt_film(np.zeros((1, 3)))
"""The values that switch parts off."""
USUAL_ALBEDO = Unknown(0.5, 0.4)
"""Of the film, and of the base under its coat: one value, found by both."""
SHARED_UNKNOWNS = {
    "gain": Unknown(MATT_FILM.gain, 0.1),
    "wrap": Unknown(MATT_FILM.wrap, 0.2),
    "base": USUAL_ALBEDO,
    "roughness": Unknown(0.25, 0.15),
    "refraction": Unknown(1.5, 0.05),
    "albedo": USUAL_ALBEDO,
    "rim": Unknown(MATT_FILM.rim, 1.0),
    "camera": Unknown(MATT_FILM.camera, 0.01),
    "diffuse": Unknown(0.2, 0.3),
}
"""By name; `diffuse` is one for each LED.  Their limits are those of a `Film`."""
SHARED_UNKNOWNS |= dict.fromkeys(STATED_UNKNOWNS, Unknown(1.0, 1.0))
EMISSION_UNKNOWN = Unknown(MATT_FILM.emission, 0.7)
"""m: an LED that faces the middle of the film emits as cos^m of the angle from its axis.  It is
fitted to the flat frame only: ignoring it would give a wrong distance there, while touched film,
relative to the flat frame, hardly depends on it."""
USUAL_NEARNESS = 0.2
"""Widths of the image over the distance of an LED."""
LED_UNKNOWNS = "x", "y", "nearness", "strength", "emission"
UNKNOWNS_PER_LED = len(LED_UNKNOWNS)
"""Number of unknowns of an LED."""
UNKNOWNS_OF_FLAT_ALONE = "strength", "emission"
"""Unknowns without effect on the light of touched film relative to the film at rest."""
UNKNOWNS_OF_TOUCH_ALONE = "gain", "wrap", "diffuse", "rim", "size"
"""Unknowns without effect on the film at rest."""
PART_UNKNOWNS = {
    "diffuse": ("diffuse", "gain", "wrap"),
    "lobe": ("base", "roughness", "refraction"),
    "bounce": ("albedo", "rim"),
    "camera": ("camera",),
}
"""The unknowns of each part of the model."""
MODEL_UNKNOWNS = PART_UNKNOWNS | {"plain": ("diffuse", "gain"), "touched": ("gain",)}
MODEL_UNKNOWNS |= {nuisance: (nuisance,) for nuisance in STATED_UNKNOWNS}
"""The unknowns of each part; of a plain film, on which light ends sharply, for finding balls; and
those that direct light determines besides the LEDs."""


def unknowns_of(parts: Iterable[str]) -> list[str]:
    """Names of the unknowns of a model.

    The albedo under a coat nearly trades off against the coat's index, so that it is no unknown of
    its own where light from film to film tells it (`with_values`).
    """
    names = [name for part in sorted(parts) for name in MODEL_UNKNOWNS[part]]
    return [name for name in names if name != "base" or "albedo" not in names]


def opened(start: Fitted, names: list[str]) -> Fitted:
    """Move newly freed parameters away from the values that switch them off."""
    changed: dict[str, Any] = {
        name: SHARED_UNKNOWNS[name].start
        for name in names
        if name not in STATED_UNKNOWNS
        and np.all(getattr(start.film, name) == getattr(MATT_FILM, name))
    }
    if "diffuse" in changed:
        changed["diffuse"] = np.full(len(start.leds), changed["diffuse"])
    return with_values(start, changed)


def priors(now: Fitted, names: list[str], width_mm: float) -> Iterator[tuple[int, float, float]]:
    """Number, departure and standard deviation of every unknown with a prior."""
    numbers = numbered(now, names)
    for k, (_, _, c, _, emission) in enumerate(now.leds):
        yield UNKNOWNS_PER_LED * k + 2, c - USUAL_NEARNESS / width_mm, USUAL_NEARNESS / width_mm
        yield UNKNOWNS_PER_LED * k + 4, emission - EMISSION_UNKNOWN.start, EMISSION_UNKNOWN.spread
    for name in names:
        about, values = SHARED_UNKNOWNS[name], np.atleast_1d(value_of(now, name))
        for number, value in zip(numbers[name].tolist(), values.tolist(), strict=True):
            yield number, value - about.start, about.spread


def surprise(now: Fitted, names: list[str], width_mm: float) -> float:
    """Return by how much the priors make a fit less likely than the usual film, as a logarithm."""
    return sum((away / sure) ** 2 for _, away, sure in priors(now, names, width_mm)) / 2


def numbered(now: Fitted, names: list[str]) -> dict[str, NDArray[np.intp]]:
    """Numbers of the shared unknowns by name: one for each LED, or one for all."""
    each = np.arange(len(now.leds))
    numbers = {name: UNKNOWNS_PER_LED * each + i for i, name in enumerate(LED_UNKNOWNS)}
    first = now.leds.size
    for name in names:
        numbers[name] = first + (each if name == "diffuse" else each[:1])
        first += numbers[name].size
    return numbers


def value_of(now: Fitted, name: str) -> Any:
    """Return the value of a shared parameter."""
    return getattr(now if name in STATED_UNKNOWNS else now.film, name)


def with_values(now: Fitted, values: dict[str, Any]) -> Fitted:
    """Return a fit with other values of shared parameters; a coat's base has the albedo."""
    nuisances = {name: values[name] for name in values if name in STATED_UNKNOWNS}
    of_film = {name: values[name] for name in values if name not in STATED_UNKNOWNS}
    film = now.film._replace(**of_film)
    if "albedo" in values and film.refraction > 1:
        film = film._replace(base=film.albedo)
    return now._replace(film=film, **nuisances)


def stepped(now: Fitted, name: str) -> tuple[Fitted, F8]:
    """The fit with an unknown changed, and the change; those of all LEDs at once.

    An LED's own unknowns change its own light alone, so one prediction serves all of them.
    """
    if name not in LED_UNKNOWNS:
        by = DERIVATIVE_STEP * SHARED_UNKNOWNS[name].spread
        return with_values(now, {name: value_of(now, name) + by}), np.array([by])
    step, leds = np.full(len(now.leds), DERIVATIVE_STEP), now.leds.copy()
    if name == "nearness":
        step *= leds[:, 2]
    leds[:, LED_UNKNOWNS.index(name)] += step
    return now.with_leds(leds), step


def differences(
    now: Fitted,
    names: list[str],
    without: tuple[str, ...],
    before: F8,
    predict: Callable[[str, Fitted], F8],
) -> F8:
    """Derivatives of `before`, K x N, by the shared unknowns, G x K x N; 0 by those `without`.

    `predict` takes the name of the unknown that was changed, and the fit.
    """
    unknowns = numbered(now, names)
    by = np.zeros((sum(map(len, unknowns.values())), *before.shape))
    for name in unknowns.keys() - {*without}:
        other, step = stepped(now, name)
        change, numbers = predict(name, other) - before, unknowns[name]
        if numbers.size > 1:
            by[numbers, np.arange(len(change))] = change / step[:, None]
        else:
            by[numbers] = change / step
    return by


def moved_by(now: Fitted, names: list[str], by: F8, shifts: F8) -> Fitted:
    """Return a fit after a step of the shared unknowns and of the balls' shifts."""
    leds = now.leds + by[: now.leds.size].reshape(now.leds.shape)
    leds[:, 2] = np.maximum(leds[:, 2], 1 / INFINITY_MM)
    leds[:, 4] = within("emission", leds[:, 4])
    changed: dict[str, Any] = {}
    numbers = numbered(now, names)
    for name in names:
        value = within(name, value_of(now, name) + by[numbers[name]])
        changed[name] = value if name == "diffuse" else float(value[0])
    return with_values(now._replace(shifts=now.shifts + shifts), changed).with_leds(leds)


def within(name: str, value: F8) -> F8:
    """Return a parameter's value within the limits of a `Film`; a given value is above 0."""
    if name in STATED_UNKNOWNS:
        return np.maximum(value, DERIVATIVE_STEP)
    stored = stored_values(Film)[name].stored
    return np.clip(value, stored.low, stored.high)
