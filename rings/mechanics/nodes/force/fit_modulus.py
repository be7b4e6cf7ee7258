"""The modulus of a gel, and how thick it is, from presses under known weights."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, MinLen
from scipy.optimize import minimize_scalar

from tactograph.rings.mechanics.nodes.force.elastic_layer import (
    MODULUS_RANGE_KPA,
    Poisson,
    Thickness,
)
from tactograph.rings.mechanics.nodes.force.press_to_pressure import press_to_pressure
from tactograph.sdk import F4, F8, Contacts, InputError, Metrics, node, read_height_file, warn
from tactograph.sdk.nodes import find_contact
from tactograph.sdk.unstable import MAX_CONTACTS, refuse_view

THICKNESS_RANGE_MM = 0.3, 30.0
"""Range in mm that a thickness is looked for in."""
MIN_PRESSES = 3
"""Fewest presses that tell modulus and thickness apart."""
LEAST_SPREAD = 0.05
"""Relative spread of the modulus, at the worst thickness, from which presses tell a thickness."""
THICKNESS_STEP = 1.01
"""Thickness, over that which is found, at which the modulus's dependence on it is taken."""
MAX_SPREAD = 0.1
"""Relative spread of the modulus over the presses that is told."""
Newtons = Annotated[float, Gt(0)]


@node
def fit_modulus(
    *,
    results: Path,
    force_n: Annotated[tuple[Newtons, ...], MinLen(1)],
    thickness_mm: Thickness | None = None,
    poisson: Poisson = 0.48,
) -> Metrics:
    """Fit Young's modulus to presses whose weight is known.

    The layer is linear: a force comes out proportional to the modulus that it is computed with,
    so each press gives one.  The thickness, if it is not given, is the one that makes those of
    presses of different depths agree.

    Parameters
    ----------
    results : a folder of results of `reconstruct` or `precise`, one per press
    force_n
        The force on each press in newtons, in order of the folders' names: a mass of 100 g is
        0.981 N.
    thickness_mm : of the gel; None: fitted, from three presses on
    poisson : Poisson's ratio of the gel

    Returns
    -------
    dict
        ``modulus_kpa``, ``thickness_mm``, and from two presses on ``modulus_error``, its
        relative standard deviation: by what moduli differ by, by what the presses' forces err by
        (`press_to_pressure`), and by the thickness, where that is fitted.

    Raises
    ------
    InputError
        If results and forces do not match in number, a press shows no contact, or presses are
        too few or too alike, or the modulus is not that of a gel.
    """
    presses = _presses(results, len(force_n))
    if thickness_mm is None and len(presses) < MIN_PRESSES:
        raise InputError(
            f"{results}: {len(presses)} presses do not tell modulus and thickness apart: measure "
            f"`thickness_mm`, or press {MIN_PRESSES} times or more, to different depths"
        )

    def moduli(thickness: float) -> F8:
        forces = [_force(press, thickness, poisson).newtons for press in presses]
        return np.asarray(force_n) / np.array(forces)

    def spread_at(log: float) -> float:
        return float(np.std(np.log(moduli(float(np.exp(log))))))

    found_mm = thickness_mm
    if found_mm is None:
        low, high = (float(np.log(end)) for end in THICKNESS_RANGE_MM)
        if max(spread_at(low), spread_at(high)) < LEAST_SPREAD:
            raise InputError(
                f"{results}: the presses are too alike to tell the thickness: press balls of "
                "different radii, or measure `thickness_mm`"
            )
        minimum = minimize_scalar(
            spread_at, bounds=(low, high), method="bounded", options={"xatol": 0.01}
        )
        found_mm = float(np.exp(minimum.x))
    each = moduli(found_mm)
    spread = float(np.std(each) / np.mean(each))
    if spread > MAX_SPREAD:
        warn(
            f"the presses' moduli spread by {spread:.0%}: is every weight in the order of the "
            "folders, and did nothing else carry it?"
        )
    modulus = float(np.mean(each))
    if not MODULUS_RANGE_KPA[0] <= modulus <= MODULUS_RANGE_KPA[1]:
        raise InputError(
            f"{results}: the modulus would be {modulus:.3g} kPa, which no gel has: are forces in "
            "newtons, and the thickness in mm?"
        )
    figures = {"modulus_kpa": modulus, "thickness_mm": found_mm}
    if len(each) > 1:
        at = [_force(press, found_mm, poisson) for press in presses]
        errs = np.array([force.deviation / force.newtons for force in at])
        thicker = moduli(found_mm * THICKNESS_STEP) if thickness_mm is None else each
        figures["modulus_error"] = _relative_error(each, thicker, errs, fitted=thickness_mm is None)
    return figures


def _relative_error(moduli: F8, thicker: F8, errs: F8, fitted: bool) -> float:
    """The relative standard deviation of the modulus, by least squares over presses.

    Each press errs by what its force does and by what moduli differ by.  Forces err alike, so
    that their mean error stays in the modulus.  `thicker` are the moduli of a thicker gel: where
    the thickness is fitted, it is a second unknown.
    """
    unknowns = 1 + fitted
    spread = np.std(moduli) / np.mean(moduli) * np.sqrt(len(moduli) / (len(moduli) - unknowns))
    by = np.stack([np.ones_like(moduli), np.log(thicker / moduli)], axis=1)[:, :unknowns]
    weighted = by / np.hypot(errs, spread)[:, None]
    chance = np.linalg.inv(weighted.T @ weighted)[0, 0]
    return float(np.sqrt(chance + np.square(errs).mean()))


def _presses(results: Path, count: int) -> Sequence[tuple[F4, Contacts, float]]:
    """Height, contacts and pixel size of every result in the folder."""
    if not results.is_dir():
        raise InputError(f"{results}: there is no such folder of results")
    if (results / "height.tiff").is_file():
        raise InputError(f"{results}: is one result; give the folder that holds one per press")
    folders = sorted(d for d in results.iterdir() if (d / "height.tiff").is_file())
    if len(folders) != count:
        raise InputError(
            f"{results}: holds {len(folders)} results, but `force_n` names {count} forces; give "
            "one per press, in order of the folders' names"
        )
    presses = []
    for folder in folders:
        refuse_view(folder / "height.tiff")
        one = read_height_file(folder / "height.tiff")
        if one.pixel is None:
            raise InputError(f"{folder}: its height.tiff does not say how large a pixel is")
        contact = find_contact(one.height)
        if not contact.any():
            raise InputError(f"{folder}: shows no contact")
        presses.append((one.height, contact, float(one.pixel)))
    return presses


class _Force(NamedTuple):
    """Of all contacts at a modulus of 1 kPa, and its standard deviation."""

    newtons: float
    deviation: float


def _force(press: tuple[F4, Contacts, float], thickness: float, poisson: float) -> _Force:
    gel = {"modulus_kpa": 1.0, "thickness_mm": thickness, "poisson": poisson}
    exact = np.zeros_like(press[0])
    figures = press_to_pressure(*press, exact, **gel, most=MAX_CONTACTS).figures
    total, deviation = (
        sum(value for name, value in figures.items() if name.startswith(f"contact_force_{each}/"))
        for each in ("n", "sd_n")
    )
    return _Force(total, deviation)
