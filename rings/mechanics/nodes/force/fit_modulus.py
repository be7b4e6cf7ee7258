"""The modulus of a gel, and how thick it is, from presses under known weights."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

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
        relative standard deviation.

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
        forces = [_force(press, thickness, poisson) for press in presses]
        return np.asarray(force_n) / np.array(forces)

    def spread_at(log: float) -> float:
        return float(np.std(np.log(moduli(float(np.exp(log))))))

    if thickness_mm is None:
        low, high = (float(np.log(end)) for end in THICKNESS_RANGE_MM)
        if max(spread_at(low), spread_at(high)) < LEAST_SPREAD:
            raise InputError(
                f"{results}: the presses are too alike to tell the thickness: press balls of "
                "different radii, or measure `thickness_mm`"
            )
        minimum = minimize_scalar(
            spread_at, bounds=(low, high), method="bounded", options={"xatol": 0.01}
        )
        thickness_mm = float(np.exp(minimum.x))
    each = moduli(thickness_mm)
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
    figures = {"modulus_kpa": modulus, "thickness_mm": thickness_mm}
    if len(each) > 1:
        figures["modulus_error"] = spread / float(np.sqrt(len(each) - 1))
    return figures


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


def _force(press: tuple[F4, Contacts, float], thickness: float, poisson: float) -> float:
    """The force in newtons of all contacts, at a modulus of 1 kPa."""
    gel = {"modulus_kpa": 1.0, "thickness_mm": thickness, "poisson": poisson}
    pressure = press_to_pressure(*press, **gel, most=MAX_CONTACTS)
    return sum(v for name, v in pressure.figures.items() if name.startswith("contact_force_n"))
