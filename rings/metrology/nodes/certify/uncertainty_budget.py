"""The budget of a height's uncertainty, its check by drawing, and by points held out."""

from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Interval
from numpy.typing import NDArray
from scipy.stats import norm, t

from tactograph.rings.metrology.nodes.certify.compare_shapes import Compared
from tactograph.rings.metrology.nodes.certify.response_curve import response_parts
from tactograph.sdk import F8, node

COVERED_SHARE = 0.9545
"""Share of a normal distribution within two standard deviations: k = 2 (GUM 6.3.3)."""
FOLD_COUNT, MIN_REMAINING = 10, 2
"""Parts that are held out in turn, and fewest shapes that the others hold: one has no spread."""
CURVE_POINTS = 100
"""Heights at which an uncertainty is computed; between them it is interpolated."""
SIGNIFICANT_DIGITS = 2
"""Of a standard uncertainty: half a unit of the last is what GUM S1 allows both to differ by."""
Distribution = Literal["normal", "rectangular"]


class BudgetRow(NamedTuple):
    """An input: what it is, its standard uncertainty, and by what it counts in a height's."""

    name: str
    uncertainty: float | None
    unit: Literal["um", "1"]
    distribution: Distribution
    sensitivity: Literal["1", "height"]
    freedom: float = np.inf
    """Degrees of freedom, by which a few shapes tell less than many."""


class Budget(NamedTuple):
    """The rows, those that were not measured too, and figures."""

    rows: list[BudgetRow]
    metrics: dict[str, float]


@node
def uncertainty_budget(
    compared: Compared,
    noise: dict[str, float],
    flatness: dict[str, float],
    *,
    radius_mm: float | None = None,
    radius_error_um: Annotated[float, Ge(0)] | None = None,
    draws: Annotated[int, Interval(ge=1000, le=10**8)] = 1_000_000,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> Budget:
    """Add up what a height may err by, u^2 = sum(c^2 u_i^2), and state it for 95.45 %.

    The model is found = (1 + A + R) true + N + F + L + T.  A: amplification, by the root mean
    square of every known shape's own departure from 1.  R: the known shapes themselves; of a cap,
    dz / z = -dR / R.  N: measurement noise.  F: flatness.  L: linearity, rectangular over its
    deviation.  T: what is left of known shapes beside all these, noise taken off.  No factor is
    corrected, so an amplification that is not 1 counts as an error.

    Points of a shape err alike, so A and T have as many degrees of freedom as there are shapes.
    By the effective ones (GUM G.4, Welch-Satterthwaite) k = 2 where shapes are many, 2.3 of ten.
    GUM S1: a million draws of all inputs, t-distributed where there are few, give the shortest
    interval of as much coverage.  Then shapes in turn are held out: a budget of the others, and
    how many of their points lie within its intervals.

    Parameters
    ----------
    compared : as `compare_shapes` gives it
    noise, flatness : as `measurement_noise` and `flatness_deviation` give them
    radius_mm, radius_error_um
        Radius of the balls, if any, and its standard uncertainty in um; None: not stated.
    draws, seed : of the check by drawing

    Returns
    -------
    Budget
        The rows; ``standard_uncertainty_um``, ``coverage_factor`` k and
        ``expanded_uncertainty_um`` at ``uncertainty_height_um``, the largest height compared;
        ``uncertainty_constant_um`` and ``uncertainty_relative``, from which it follows at any
        other; ``monte_carlo_um``, half the interval by drawing, and ``monte_carlo_agrees``; of
        three shapes or more ``held_out_percent`` and, as shapes differ, its standard uncertainty
        ``held_out_error_percent``; of a stated error ``stated_error_percent``, the points within
        twice.
    """
    reference = radius_error_um / 1e3 / radius_mm if radius_error_um and radius_mm else None
    rows = _rows(compared, noise, flatness, reference)
    true, measured, stated, *_ = compared
    if not len(true):
        return Budget(rows, {})
    top = 1e3 * float(np.abs(true).max())
    constant, relative = (float(np.sqrt(_variances(rows, z).sum())) for z in (0.0, 1.0))
    relative = float(np.sqrt(relative**2 - constant**2))
    standard, factor = _standard(rows, top)
    expanded = factor * standard
    drawn = _drawn(rows, top, draws, np.random.default_rng(seed))
    figures: dict[str, float] = {
        "uncertainty_height_um": top,
        "standard_uncertainty_um": standard,
        "coverage_factor": factor,
        "expanded_uncertainty_um": expanded,
        "uncertainty_constant_um": constant,
        "uncertainty_relative": relative,
        "monte_carlo_um": drawn,
        "monte_carlo_agrees": abs(drawn - expanded) <= factor * _last_digit(standard) / 2,
    }
    held_out = _held_out(compared, noise, flatness, reference)
    if held_out is not None:
        figures["held_out_percent"], figures["held_out_error_percent"] = held_out
    if np.isfinite(stated).any():
        is_stated = stated > 0
        deviations = np.abs(measured - true)[is_stated] / stated[is_stated]
        within = deviations <= norm.ppf((1 + COVERED_SHARE) / 2)
        figures["stated_error_percent"] = 100 * float(within.mean())
    return Budget(rows, figures)


def _rows(
    compared: Compared, noise: dict[str, float], flatness: dict[str, float], reference: float | None
) -> list[BudgetRow]:
    n, f = noise.get("measurement_noise_um"), flatness.get("flatness_rms_um")
    amplification = linearity = fidelity = None
    shapes = np.inf
    true, measured, _, shape, _ = compared
    if len(true):
        parts = response_parts(true, measured, shape)
        shapes = float(len(parts.shapes))
        amplification = float(np.sqrt(np.mean(np.square(parts.shapes - 1))))
        linearity = 1e3 * parts.linearity / np.sqrt(3)
        square = 1e6 * float(np.mean(np.square(parts.residual)))
        independent = (n or 0.0) ** 2 + (f or 0.0) ** 2 + linearity**2
        fidelity = float(np.sqrt(max(square - independent, 0.0)))
    return [
        BudgetRow("measurement noise", n, "um", "normal", "1"),
        BudgetRow("residual flatness", f, "um", "normal", "1"),
        BudgetRow("amplification", amplification, "1", "normal", "height", shapes),
        BudgetRow("linearity", linearity, "um", "rectangular", "1"),
        BudgetRow("topography fidelity", fidelity, "um", "normal", "1", shapes),
        BudgetRow("known shapes", reference, "1", "normal", "height"),
    ]


def _variances(rows: list[BudgetRow], height_um: float) -> F8:
    """The square of what every input counts at a height, in um^2."""
    by = {"1": 1.0, "height": height_um}
    return np.array([((row.uncertainty or 0.0) * by[row.sensitivity]) ** 2 for row in rows])


def _standard(rows: list[BudgetRow], height_um: float) -> tuple[float, float]:
    """The standard uncertainty in um, and the factor by which it holds `COVERED_SHARE`."""
    parts = _variances(rows, height_um)
    rare = float((np.square(parts) / [row.freedom for row in rows]).sum())
    freedom = parts.sum() ** 2 / rare if rare else np.inf
    return float(np.sqrt(parts.sum())), float(t.ppf((1 + COVERED_SHARE) / 2, freedom))


def _drawn(rows: list[BudgetRow], height_um: float, draws: int, rng: np.random.Generator) -> float:
    """Half the shortest interval that holds `COVERED_SHARE` of the drawn errors, in um."""
    error = np.zeros(draws)
    for row, scale in zip(rows, np.sqrt(_variances(rows, height_um)), strict=True):
        if not scale:
            continue
        if row.distribution == "rectangular":
            error += scale * np.sqrt(3) * rng.uniform(-1, 1, draws)
        elif np.isfinite(row.freedom):
            error += scale * rng.standard_t(row.freedom, draws)
        else:
            error += scale * rng.standard_normal(draws)
    error.sort()
    inside = round(COVERED_SHARE * draws)
    return float((error[inside:] - error[: draws - inside]).min() / 2)


def _last_digit(value: float) -> float:
    """The unit of the last significant digit."""
    return float(10.0 ** (np.floor(np.log10(max(value, 1e-12))) - SIGNIFICANT_DIGITS + 1))


def _held_out(compared: Compared, *others: Any) -> tuple[float, float] | None:
    """Per cent of points within intervals of the budget that other shapes give, and its doubt."""
    true, measured, stated, shape, touch = compared
    numbers = np.unique(shape)
    if len(numbers) <= MIN_REMAINING:
        return None
    inside, fold_count = np.zeros(len(true), bool), min(FOLD_COUNT, len(numbers))
    for fold in range(fold_count):
        out = np.isin(shape, numbers[fold::fold_count])
        fitted = Compared(true[~out], measured[~out], stated[~out], shape[~out], touch[~out])
        inside[out] = _within(true[out], measured[out], _rows(fitted, *others))
    by_shape = np.array([inside[shape == number].mean() for number in numbers])
    return 100 * float(inside.mean()), 100 * float(by_shape.std(ddof=1) / np.sqrt(len(numbers)))


def _within(true: F8, measured: F8, rows: list[BudgetRow]) -> NDArray[np.bool_]:
    height = 1e3 * np.abs(true)
    at = np.linspace(0, height.max(), CURVE_POINTS)
    half = np.interp(height, at, [np.prod(_standard(rows, float(z))) for z in at])
    return np.asarray(1e3 * np.abs(measured - true) <= half)
