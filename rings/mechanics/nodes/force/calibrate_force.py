"""The modulus of a gel, and how thick it is, from presses of known force."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from scipy.optimize import minimize_scalar
from scipy.special import ndtri, stdtrit

from tactograph.rings.mechanics.nodes.force._pressed_layer import pressed_layer
from tactograph.rings.mechanics.nodes.force.elastic_layer import (
    MODULUS_RANGE_KPA,
    Poisson,
    Thickness,
)
from tactograph.rings.mechanics.nodes.force.press_to_pressure import (
    CELL_PX,
    depth_of,
    press_on,
    warn_of_limits,
)
from tactograph.sdk import (
    F4,
    F8,
    Contacts,
    HeightFile,
    InputError,
    LargestContacts,
    View,
    node,
    warn,
)
from tactograph.sdk.nodes import find_contact, read_height

THICKNESS_RANGE_MM = 0.3, 30.0
THICKNESS_COUNT = 12
"""Range in mm that a thickness is looked for in, and on how many it begins: by halves more each."""
MIN_PRESSES = 3
"""Fewest presses that tell modulus and thickness apart."""
LEAST_SPREAD = 0.05
"""Relative spread of the modulus, at the worst thickness, from which presses tell a thickness."""
THICKNESS_STEP = 1.01
"""Thickness, over that which is found, at which the modulus's dependence on it is taken."""
MAX_SPREAD = 0.1
"""Relative spread of the modulus over the presses that causes a warning."""
FORCE_COLUMN = "force_n"
Newtons = Annotated[float, Gt(0)]


@node
def calibrate_force(
    *,
    results: Path,
    forces: Path | None = None,
    force_n: tuple[Newtons, ...] | None = None,
    thickness_mm: Thickness | None = None,
    thickness_error_mm: Annotated[float, Ge(0)] = 0.0,
    poisson: Poisson = 0.48,
) -> dict[str, float]:
    """Fit Young's modulus to presses whose force is known, and hold each out in turn.

    The layer is linear: a force comes out proportional to the modulus that it is computed with,
    so each press gives one.  The thickness, if it is not given, is the one that makes those of
    presses of different depths agree.

    Parameters
    ----------
    results
        A folder of results of a reconstruction, one per press, or per frame of a stream.
    forces
        A CSV with the columns ``name``, of a result's folder, and ``force_n``, in newtons.
        Results that it does not name are left out.
    force_n
        In its place, the force on each press in newtons, in order of the folders' names: a mass
        of 100 g is 0.981 N.
    thickness_mm : of the gel; None: fitted, from three presses on
    thickness_error_mm : standard deviation of the thickness that is given
    poisson : Poisson's ratio of the gel

    Returns
    -------
    dict
        ``modulus_kpa``, ``thickness_mm``; ``thickness_percent``, what the thickness's error does to
        the modulus.  From two presses on ``held_out_n`` and ``held_out_percent``, root mean
        square distance of a press's force from that by the modulus of the others (and the thickness
        of all), and ``modulus_error``, its relative standard deviation: by what moduli differ by,
        by what the presses' forces err by (`press_to_pressure`), and by the thickness.

    Raises
    ------
    InputError
        If results and forces do not match, a press shows no contact, or presses are too few or too
        alike, or the modulus is not that of a gel.
    """
    by_name = _forces(results, forces, force_n)
    presses, newtons = _presses(results, by_name), np.array([*by_name.values()])
    deepest = max(depth_of(height, contact) for height, contact, _ in presses)
    most = thickness_mm or THICKNESS_RANGE_MM[1]
    if deepest >= most:
        raise InputError(
            f"{results}: a press is {deepest:.3g} mm deep, more than a gel of {most:g} mm is "
            "thick: check `thickness_mm`, and the scale of the heights"
        )
    if thickness_mm is None and len(presses) < MIN_PRESSES:
        raise InputError(
            f"{results}: {len(presses)} presses do not tell modulus and thickness apart: measure "
            f"`thickness_mm`, or press {MIN_PRESSES} times or more, to different depths"
        )

    def moduli(thickness: float) -> F8:
        return newtons / np.array([_force(press, thickness, poisson)[0] for press in presses])

    gel_mm = _thickness(moduli, deepest, results) if thickness_mm is None else thickness_mm
    each = moduli(gel_mm)
    for height, contact, _ in presses:
        warn_of_limits(height, contact, gel_mm)
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
    thicker = moduli(gel_mm * THICKNESS_STEP)
    by_thickness = float(np.mean(np.log(thicker / each)) / np.log(THICKNESS_STEP))
    unsure = abs(by_thickness) * thickness_error_mm / gel_mm if thickness_mm is not None else 0.0
    figures = {
        "modulus_kpa": modulus,
        "thickness_mm": gel_mm,
        "thickness_percent": 100 * unsure,
    }
    if len(each) > 1:
        others = (each.sum() - each) / (len(each) - 1)
        off = others / each - 1
        figures["held_out_n"] = float(np.sqrt(np.mean((off * newtons) ** 2)))
        figures["held_out_percent"] = 100 * float(np.sqrt(np.mean(off**2)))
        at = np.array([_force(press, gel_mm, poisson) for press in presses])
        errors = at[:, 1] / at[:, 0]
        fitted = thickness_mm is None
        chance = _relative_error(each, thicker if fitted else each, errors, fitted=fitted)
        figures["modulus_error"] = float(np.hypot(chance, unsure))
    return figures


def _thickness(moduli: Callable[[float], F8], deepest: float, results: Path) -> float:
    """The thickness in mm at which the presses' moduli spread least; no press is deeper."""

    def spread_at(log: float) -> float:
        return float(np.std(np.log(moduli(float(np.exp(log))))))

    thinnest, thickest = THICKNESS_RANGE_MM
    logs = np.log(np.geomspace(max(thinnest, deepest), thickest, THICKNESS_COUNT))
    spreads = [spread_at(float(log)) for log in logs]
    if max(spreads) < LEAST_SPREAD:
        raise InputError(
            f"{results}: the presses are too alike to tell the thickness: press balls of "
            "different radii, or measure `thickness_mm`"
        )
    # Layers far too thin fit alike again: of several minima the lowest counts.
    bounds = logs[np.argmin(spreads)] + (logs[1] - logs[0]) * np.array([-1, 1])
    bounds = np.maximum(bounds, logs[0])
    minimum = minimize_scalar(spread_at, bounds=bounds, method="bounded", options={"xatol": 0.01})
    return float(np.exp(minimum.x))


def _relative_error(moduli: F8, thicker: F8, errors: F8, fitted: bool) -> float:
    """The relative standard deviation of the modulus, by least squares over presses.

    `errors` are the relative standard deviations of the presses' forces; to these comes what the
    moduli differ by.  Forces err alike, so their mean error stays in the modulus.  `thicker` are
    the moduli of a thicker gel: where the thickness is fitted, it is a second unknown.
    """
    unknowns, count = 1 + fitted, len(moduli)
    spread = np.std(moduli) / np.mean(moduli) * np.sqrt(count / (count - unknowns))
    # Few presses determine a deviation badly: Student's 90 % band is wider than the normal one.
    spread *= stdtrit(count - unknowns, 0.95) / ndtri(0.95)
    by = np.stack([np.ones_like(moduli), np.log(thicker / moduli)], axis=1)[:, :unknowns]
    weighted = by / np.hypot(errors, spread)[:, None]
    chance = np.linalg.inv(weighted.T @ weighted)[0, 0]
    return float(np.sqrt(chance + np.square(errors).mean()))


def _forces(
    results: Path, forces: Path | None, force_n: tuple[float, ...] | None
) -> dict[str, float]:
    """The force on each result that has one, by the name of its folder."""
    if not results.is_dir():
        raise InputError(f"{results}: there is no such folder of results")
    if (results / "height.tiff").is_file():
        raise InputError(f"{results}: is one result; give the folder that holds one per press")
    names = sorted(d.name for d in results.iterdir() if (d / "height.tiff").is_file())
    if (forces is None) == (force_n is None):
        raise InputError("give `forces`=CSV or `force_n`=NUMBERS, one of both")
    if forces is not None:
        by_name = _read_forces(forces)
        missing = [name for name in by_name if name not in names]
        if missing or not by_name:
            what = f"no result is called {missing[0]}" if missing else "names no force"
            raise InputError(f"{forces}: {what}; {results} holds {len(names)} results")
        return by_name
    assert force_n is not None
    if len(names) != len(force_n):
        raise InputError(
            f"{results}: holds {len(names)} results, but `force_n` names {len(force_n)} forces; "
            "give one per press, in order of the folders' names"
        )
    return dict(zip(names, force_n, strict=True))


def _read_forces(file: Path) -> dict[str, float]:
    """Names and newtons of a CSV."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            rows = [
                (row["name"].strip(), float(row[FORCE_COLUMN])) for row in csv.DictReader(lines)
            ]
    except (OSError, UnicodeError, csv.Error) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    except (KeyError, AttributeError, TypeError, ValueError):
        raise InputError(
            f"{file}: needs the columns name and {FORCE_COLUMN}, and a number of newtons in each "
            "row"
        ) from None
    by_name = dict(rows)
    if len(by_name) < len(rows) or not all(0 < newtons < np.inf for newtons in by_name.values()):
        raise InputError(f"{file}: each name needs one row, with a force above 0 N")
    return by_name


def _presses(results: Path, names: Iterable[str]) -> Sequence[tuple[F4, Contacts, float]]:
    """Height, contacts and pixel size of the results of these names."""
    presses = []
    for folder in (results / name for name in names):
        file = folder / "height.tiff"
        height, pixel = read_height(file=file), HeightFile.read(file).pixel
        if pixel is None:
            raise InputError(f"{folder}: its height.tiff does not say how large a pixel is")
        contact = find_contact(height)
        if not contact.any():
            raise InputError(f"{folder}: shows no contact")
        presses.append((height, contact, float(pixel)))
    return presses


def _force(
    press: tuple[F4, Contacts, float], thickness: float, poisson: float
) -> tuple[float, float]:
    """The force of all contacts at a modulus of 1 kPa, and its standard deviation."""
    height, contact, pixel = press
    layer = pressed_layer(height.shape, pixel, CELL_PX, 1.0, thickness, poisson)
    exact, every = np.zeros_like(height), LargestContacts(int(contact.max()))
    figures = press_on(layer, height, contact, pixel, exact, View(), every).figures
    return _total(figures, "n"), _total(figures, "sd_n")


def _total(figures: dict[str, float], what: str) -> float:
    return sum(
        value for name, value in figures.items() if name.startswith(f"contact_force_{what}/")
    )
