"""The unknowns of a film's fit: start values, priors, and steps from one fit to another."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F8, Film
from tactograph.nodes.calibrate import (
    LED_DRIFT,
    LED_DRIFT_ACROSS,
    MIN_BOUNCE_ERROR,
    SHIFT_DEVIATION_PX,
)
from tactograph.nodes.calibrate.ball.balls_on_film import Fitted
from tactograph.nodes.calibrate.lights.descend import DERIVATIVE_STEP
from tactograph.nodes.calibrate.lights.light_fit import INFINITY_MM
from tactograph.nodes.stored import stored_values


class Unknown(NamedTuple):
    """A parameter of a usual sensor, where the fit starts, its standard deviation and limits."""

    start: float = 0.0
    spread: float = math.inf
    low: float = -math.inf
    high: float = math.inf

    @staticmethod
    def of(name: str) -> "Unknown":
        """Return an unknown of LEDs or film; the limits are those of a `Film`."""
        each = (LED_UNKNOWNS | SHARED_UNKNOWNS | USUAL_CHANGES)[name]
        if name not in Film._fields:
            return each
        stored = FILM_VALUES[name].stored
        return each._replace(low=max(each.low, stored.low), high=stored.high)

    def within(self, value: F8) -> F8:
        """Return values within the limits."""
        return np.clip(value, self.low, self.high)


STATED_UNKNOWNS = "size", "power"
"""Unknowns of what was stated, not of the film: the balls' radius and the camera's gamma."""
FILM_VALUES = stored_values(Film)
PLAIN_FILM: dict[str, Any] = {name: stored.plain for name, (_, stored) in FILM_VALUES.items()}
"""The values that switch parts off."""
USUAL_ALBEDO = Unknown(0.5, 0.4)
"""Of the film, and of the base under its coat: one value, found by both."""
NARROWEST_BEAM = math.log(0.5, math.cos(math.radians(8)))
"""m of an LED that emits half as much 8 degrees from its axis, the narrowest that is sold."""
USUAL_NEARNESS = 0.2
"""Widths of the image over the distance of an LED."""
LED_UNKNOWNS = {
    "x": Unknown(),
    "y": Unknown(),
    "nearness": Unknown(USUAL_NEARNESS, USUAL_NEARNESS, 1 / INFINITY_MM),
    "strength": Unknown(spread=1.0),
}
"""An LED's own, in the order of `Fitted.leds`.  The film at rest leaves the strengths' common
factor free, and without a flat frame all of them, so that a prior holds them."""
SHARED_UNKNOWNS = {
    "emission": Unknown(PLAIN_FILM["emission"], math.log1p(NARROWEST_BEAM) / 2, low=0),
    "aim": Unknown(1.0, 1.0),
    "gain": Unknown(PLAIN_FILM["gain"], 0.1),
    "wrap": Unknown(PLAIN_FILM["wrap"], 0.2),
    "base": USUAL_ALBEDO,
    "roughness": Unknown(0.25, 0.15),
    "refraction": Unknown(1.5, 0.05),
    "albedo": USUAL_ALBEDO,
    "rim": Unknown(PLAIN_FILM["rim"], 1.0),
    "camera": Unknown(PLAIN_FILM["camera"], 0.01),
    "diffuse": Unknown(0.2, 0.3),
}
"""By name; `diffuse` is one for each LED.  Their limits are those of a `Film`.

Of `emission`, m of LEDs that emit as cos^m, the deviation is that of log(1 + m), and two of it
reach from a point to the narrowest lens; none emits more beside its axis.  It is fitted to the flat
frame only: ignoring it would give a wrong distance there, while touched film, relative to the flat
frame, hardly depends on it."""
SHARED_UNKNOWNS |= dict.fromkeys(STATED_UNKNOWNS, Unknown(1.0, 1.0, DERIVATIVE_STEP))
USUAL_CHANGES = {
    "place_px": Unknown(spread=SHIFT_DEVIATION_PX),
    "led_drift": Unknown(1.0, LED_DRIFT),
    "led_drift_across": Unknown(spread=LED_DRIFT_ACROSS),
    "bounced": Unknown(1.0, MIN_BOUNCE_ERROR),
}
"""What is not fitted: an object's place, an LED's light since the flat frame and how that changes
across the image, and the light from film to film over that of the model."""
UNKNOWNS_OF_FLAT_ALONE = "strength", "emission", "aim"
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
MODEL_UNKNOWNS |= {name: (name,) for name in (*STATED_UNKNOWNS, "aim")}
"""The unknowns of each part; of a plain film, on which light ends sharply, for finding balls; and
those that direct light determines besides the LEDs."""


class Unknowns(NamedTuple):
    """The unknowns of a fit by name, without the balls' shifts, and the width of the image in mm.

    One for each LED, or one for all: together U numbers, in this order.
    """

    names: tuple[str, ...]
    width_mm: float

    @classmethod
    def of(cls, parts: Iterable[str], width_mm: float) -> "Unknowns":
        """Return the unknowns of a model.

        The albedo under a coat nearly trades off against the coat's index, so that it is no unknown
        of its own where light from film to film tells it (`with_values`).
        """
        names = [name for part in sorted(parts) for name in MODEL_UNKNOWNS[part]]
        names = [name for name in names if name != "base" or "albedo" not in names]
        return cls((*LED_UNKNOWNS, "emission", *names), width_mm)

    def numbers(self, now: Fitted) -> dict[str, NDArray[np.intp]]:
        """Return the numbers of the unknowns by name."""
        each = {*LED_UNKNOWNS, "diffuse"}
        sizes = [len(now.leds) if name in each else 1 for name in self.names]
        parts = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
        return dict(zip(self.names, parts, strict=False))

    def values(self, now: Fitted) -> F8:
        """Return the values of a fit, of length U."""
        own = dict(zip(LED_UNKNOWNS, now.leds.T, strict=True))
        held = {name: now if name in STATED_UNKNOWNS else now.film for name in self.names}
        values = [own[name] if name in own else getattr(held[name], name) for name in self.names]
        return np.hstack([*values, np.empty(0)])

    def with_values(self, now: Fitted, values: F8) -> Fitted:
        """Return a fit with other values, U; a coat's base has the albedo."""
        leds, stated, film = now.leds.copy(), dict[str, Any](), dict[str, Any]()
        for name, at in self.numbers(now).items():
            if name in LED_UNKNOWNS:
                leds[:, list(LED_UNKNOWNS).index(name)] = values[at]
            elif name in STATED_UNKNOWNS:
                stated[name] = float(values[at][0])
            else:
                film[name] = values[at] if name == "diffuse" else float(values[at][0])
        if "albedo" in film and film.get("refraction", now.film.refraction) > 1:
            film["base"] = film["albedo"]
        return now._replace(film=now.film._replace(**film), **stated).with_leds(leds)

    def opened(self, start: Fitted) -> Fitted:
        """Move newly freed parameters away from the values that switch them off."""
        values = self.values(start)
        for name, at in self.numbers(start).items():
            if name not in LED_UNKNOWNS and np.all(values[at] == PLAIN_FILM.get(name)):
                values[at] = SHARED_UNKNOWNS[name].start
        return self.with_values(start, values)

    def moved(self, now: Fitted, by: F8, shifts: F8) -> Fitted:
        """Return a fit after a step of U unknowns and of the balls' shifts, within all limits."""
        values = self.values(now) + by
        for name, at in self.numbers(now).items():
            values[at] = Unknown.of(name).within(values[at])
        return self.with_values(now._replace(shifts=now.shifts + shifts), values)

    def priors(self, now: Fitted) -> tuple[F8, F8]:
        """Return the departures of a fit from a usual sensor, and their standard deviations: U."""
        usual, numbers = np.empty((self.values(now).size, 2)), self.numbers(now)
        for name, at in numbers.items():
            unit = self.width_mm if name == "nearness" else 1.0
            usual[at] = np.divide(Unknown.of(name)[:2], unit)
        away = self.values(now) - usual[:, 0]
        if (own := numbers.get("emission")) is not None:
            # That of log(1 + m), linear about m.
            change = 1 + away[own]
            away[own], usual[own, 1] = change * np.log(change), change * usual[own, 1]
        return away, usual[:, 1]

    def surprise(self, now: Fitted) -> float:
        """Return by how much priors make a fit less likely than the usual film, as a logarithm."""
        away, sure = self.priors(now)
        return float(np.square(away / sure).sum()) / 2

    def differences(
        self,
        now: Fitted,
        without: tuple[str, ...],
        before: F8,
        predict: Callable[[str, Fitted], F8],
    ) -> F8:
        """Return derivatives of `before`, K x N, by the unknowns, U x K x N; 0 by those `without`.

        `predict` takes the name of the unknown that was changed, and the fit.  An LED's own
        unknowns change its own light alone, so one prediction serves all of them.
        """
        values, spread = self.values(now), self.priors(now)[1]
        steps = DERIVATIVE_STEP * np.where(np.isinf(spread), 1, spread)
        by = np.zeros((values.size, *before.shape))
        for name, at in self.numbers(now).items():
            if name in without:
                continue
            other = values.copy()
            other[at] += steps[at]
            change = predict(name, self.with_values(now, other)) - before
            own = np.arange(len(change)) if at.size > 1 else slice(None)
            by[at, own] = change / steps[at[0]]
        return by
