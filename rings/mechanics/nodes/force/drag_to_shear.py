"""The shear that drags the film, and the shear force and torque on every contact.

Long because the answer of a layer to a traction is tabulated here: nothing else needs it.
"""

from functools import lru_cache
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import cho_factor, cho_solve
from scipy.special import j0, j1

from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.nodes.force.elastic_layer import (
    Modulus,
    Poisson,
    Thickness,
    layer_compliance,
)
from tactograph.rings.mechanics.nodes.force.press_to_pressure import NEWTONS_PER_KPA_MM2, Pressure
from tactograph.rings.mechanics.nodes.marker.marker_places import marker_places
from tactograph.sdk import F4, F8, Contacts, Height, LargestContacts, PixelSize, Port, View, node

Shear = Annotated[F4, Port("2 H W", "kPa", low=-50, high=50)]
"""Traction on the film in its plane, x and y."""
MAX_CELLS = 150
"""Whole cells in all contacts together, at most."""
TABLE_STEPS = 200
"""Distances at which the answer to a traction is tabulated."""
MAX_WAVE_SIDES = 14.0
"""Largest wave number times a cell's side."""
FORCE_TOTALS = ("shear", "x_n"), ("shear", "y_n"), ("torque", "n_mm")
MIN_MARKERS = 2
"""Least number of markers on a contact that tell its shear."""


class ShearForce(NamedTuple):
    """Shear by pixel, and figures by contact."""

    shear: Shear
    figures: dict[str, float]


class _Cells(NamedTuple):
    """N parts of contacts: their numbers, places N x 2 and areas in mm, and pressures."""

    of_pixel: NDArray[np.intp]
    """H x W, the cell of each pixel; -1 outside the contacts."""
    number: NDArray[np.intp]
    place: F8
    area: F8
    pressure: F8


@node
def drag_to_shear(
    height: Height,
    contact: Contacts,
    pressure: Pressure,
    tracks: MarkerTracks,
    pixel: PixelSize,
    view: View | None = None,
    *,
    modulus_kpa: Modulus,
    thickness_mm: Thickness,
    poisson: Poisson = 0.48,
    modulus_error: Annotated[float, Interval(ge=0, le=1)] = 0.0,
    marker_error_px: Annotated[float, Gt(0)] = 0.05,
    largest: LargestContacts,
) -> ShearForce:
    """Find the shear, inside the contacts only, that drags the film's markers to where they are.

    The gel is an elastic layer bonded to its window (`elastic_layer`).  What its pressure moves
    the markers by is subtracted.  Of all shears that fit the rest within the markers' error, the
    likeliest is taken: a shear is taken to be alike within a contact's radius, the more so the
    nearer, and as large as the markers' way says (a Gaussian process, as in traction force
    microscopy: Style et al., "Traction force microscopy in physics and biology", 2014).  Its
    spread gives the deviations.

    Parameters
    ----------
    height : H x W in mm, as seen by the camera
    contact : H x W, the number of the contact at each pixel
    pressure : H x W in kPa, by `press_to_pressure`
    tracks : the film's markers, by `track_markers`
    pixel : mm per px
    view : the calibration, for the lens and the camera's height
    modulus_kpa, thickness_mm, poisson, modulus_error : of the gel, as for `press_to_pressure`
    marker_error_px : standard deviation of a marker's place

    Returns
    -------
    Shear 2 x H x W in kPa, and for each contact that has two markers or more its shear force
    ``contact_shear_x_n/c1``, ``contact_shear_y_n/c1``, its torque about the contact's middle,
    positive from x to y, ``contact_torque_n_mm/c1``, and their standard deviations
    ``contact_shear_sd_x_n/c1`` and so on.
    """
    markers = marker_places(height, tracks, pixel, view)
    is_tracked = (tracks.visible > 0) & markers.inside
    measured = largest.numbers(contact)
    count = np.bincount(contact[markers.pixel][is_tracked], minlength=256)
    count[0] = 0
    contact = np.where(count[contact] >= MIN_MARKERS, contact, np.uint8(0))
    if not contact.any():
        return ShearForce(np.zeros((2, *height.shape), np.float32), {})
    side_px = int(np.ceil(np.sqrt(np.count_nonzero(contact) / MAX_CELLS)))
    cells = _cells(height, contact, pressure, pixel, view or View(), side_px)
    place, rest = markers.place[is_tracked, :2], markers.rest[is_tracked]
    table = _table(thickness_mm, poisson, side_px * pixel, pixel * float(np.hypot(*height.shape)))
    by_shear, by_pressure = _moved(place, cells, table)
    drag = (place - rest).T.ravel() - by_pressure @ cells.pressure / modulus_kpa
    numbers, sums = _sums(cells)
    shear, chance = _likeliest(by_shear / modulus_kpa, drag, cells, sums, marker_error_px * pixel)
    total = sums @ shear
    deviation = np.hypot(chance, modulus_error * total)
    figures: dict[str, float] = {}
    for name, value, spread in zip(product(numbers, FORCE_TOTALS), total, deviation, strict=True):
        number, (what, unit) = name
        if number not in measured:
            continue
        figures[f"contact_{what}_{unit}/c{number}"] = float(value)
        figures[f"contact_{what}_sd_{unit}/c{number}"] = float(spread)
    by_cell = np.pad(shear.reshape(2, -1), ((0, 0), (0, 1))).astype(np.float32)
    return ShearForce(by_cell[:, cells.of_pixel], figures)


def _cells(
    height: Height, contact: Contacts, pressure: F4, pixel: float, view: View, side: int
) -> _Cells:
    """Squares of `side` px, cut along the contacts' borders."""
    row, column = np.nonzero(contact)
    number = contact[row, column].astype(np.intp)
    across = contact.shape[1] // side + 1
    square = row // side * across + column // side
    name = number * (square.max() + 1) + square
    used = np.flatnonzero(np.bincount(name))
    index = np.searchsorted(used, name)
    size = np.bincount(index)

    def mean(values: NDArray[Any]) -> F8:
        return np.bincount(index, values) / size

    place = np.stack(view.ideal(contact.shape, mean(column), mean(row)))
    nearer = 1 - mean(height[row, column]) * (view.camera or 0.0)
    everywhere = np.full(contact.shape, -1)
    everywhere[row, column] = index
    return _Cells(
        everywhere,
        mean(number).astype(np.intp),
        np.asarray(pixel * nearer * place, np.float64).T,
        np.asarray(size * pixel**2, np.float64),
        mean(pressure[row, column]),
    )


@lru_cache(maxsize=16)
def _table(thickness: float, poisson: float, side: float, reach: float) -> BSpline:
    """The way in mm of the face by the root of the distance in mm, per kPa mm^2 at 1 kPa.

    The tensor of a shear is near (1 0, 0 1) + turned (2 u u - 1), u the unit vector to the place;
    a pressure moves by aside u.  All are Hankel transforms of the compliance and of a cell, taken
    as the Gaussian as wide as a square of `side`.
    """
    r = reach * np.linspace(0, 1, TABLE_STEPS) ** 2
    k = np.arange(0.5, 4 * reach * MAX_WAVE_SIDES / side, dtype=np.float64) / (4 * reach)
    answer = layer_compliance(k, thickness, poisson)
    waves = k * np.exp(-((k * side) ** 2) / 24) / (8 * np.pi * reach)
    x = np.outer(r, k)
    zeroth, first = j0(x), j1(x)
    second = 2 * first / np.maximum(x, 1e-9) - zeroth
    second[0] = 0
    near = zeroth @ (waves * (answer.along + answer.across) / 2)
    turned = second @ (waves * (answer.across - answer.along) / 2)
    aside = -first @ (waves * answer.coupled)
    return make_interp_spline(np.sqrt(r), np.column_stack([near, turned, aside]), k=1)


def _moved(place: F8, cells: _Cells, table: BSpline) -> tuple[F8, F8]:
    """The way of M places in mm by shears of 1 kPa, 2 M x 2 N, and pressures, 2 M x N."""
    away = place[:, None] - cells.place
    distance = np.hypot(away[..., 0], away[..., 1])
    near, turned, aside = np.moveaxis(table(np.sqrt(distance)), 2, 0) * cells.area
    u, v = np.moveaxis(away, 2, 0) / np.maximum(distance, 1e-9)
    both = 2 * turned * u * v
    by_shear = np.block(
        [[near + turned * (2 * u * u - 1), both], [both, near + turned * (2 * v * v - 1)]]
    )
    return by_shear, np.concatenate([aside * u, aside * v])


def _sums(cells: _Cells) -> tuple[NDArray[np.intp], F8]:
    """Numbers of the C contacts, and 3 C x 2 N: from shear in kPa to force and torque of each."""
    numbers, rows = np.unique(cells.number), []
    for number in numbers:
        area = np.where(cells.number == number, NEWTONS_PER_KPA_MM2 * cells.area, 0.0)
        x, y = (cells.place - area @ cells.place / area.sum()).T * area
        rows += [(area, 0 * area), (0 * area, area), (-y, x)]
    return numbers, np.array(rows).reshape(len(rows), -1)


def _likeliest(answer: F8, drag: F8, cells: _Cells, sums: F8, error: float) -> tuple[F8, F8]:
    """The shear, 2 N in kPa, where markers moved by `drag`, and the deviations of its sums."""
    apart = np.hypot(*(cells.place[:, None] - cells.place).transpose(2, 0, 1))
    radius = np.sqrt(np.bincount(cells.number, cells.area) / np.pi)[cells.number]
    alike = np.exp(-apart / radius) * (cells.number[:, None] == cells.number)
    root = np.linalg.cholesky(alike)
    carried, summed = ((m.reshape(-1, len(root)) @ root).reshape(m.shape) for m in (answer, sums))
    spread = carried @ carried.T
    noise = error**2 * len(drag)
    # A shear below the noise is indistinguishable from none.
    size = max(drag @ drag - noise, noise * np.sqrt(2 / len(drag))) / np.trace(spread)
    factor = cho_factor(size * spread + error**2 * np.eye(len(drag)), overwrite_a=True)
    cross_covariance = size * carried @ summed.T
    solved = cho_solve(factor, np.column_stack([drag, cross_covariance]))
    misfit = max(1.0, float(drag @ solved[:, 0]) / len(drag))
    residual = size * np.sum(summed**2, axis=1) - np.sum(cross_covariance * solved[:, 1:], axis=0)
    shear = size * (solved[:, 0] @ carried).reshape(2, -1) @ root.T
    return shear.ravel(), np.sqrt(misfit * residual)
