"""The pressure that presses the film in, and the force on every contact."""

from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.rings.mechanics.nodes.force._pressed_layer import (
    PressedLayer,
    force_deviation,
    pressed_layer,
)
from tactograph.rings.mechanics.nodes.force.elastic_layer import Modulus, Poisson, Thickness
from tactograph.sdk import (
    F4,
    Contacts,
    Height,
    HeightError,
    LargestContacts,
    PixelSize,
    Port,
    View,
    node,
    warn,
)
from tactograph.sdk.nodes import coarsen

Pressure = Annotated[F4, Port("H W", "kPa", low=-5, high=100)]
"""Normal pressure on the film."""
NEWTONS_PER_KPA_MM2 = 1e-3
"""A kPa mm^2 in newtons."""
CELL_PX = 2
"""Side of the cells that have a pressure of their own."""
MAX_STRAIN = 0.3
"""Depth over thickness above which a linear layer is too soft."""
MAX_BORDER_SHARE = 0.01
"""Share of the contact at the image's border from which its force is only a part."""


class PressForce(NamedTuple):
    """Pressure by pixel, and figures by contact."""

    pressure: Pressure
    figures: dict[str, float]


@node
def press_to_pressure(
    height: Height,
    contact: Contacts,
    pixel: PixelSize,
    error: HeightError | None = None,
    view: View | None = None,
    *,
    modulus_kpa: Modulus,
    thickness_mm: Thickness,
    poisson: Poisson = 0.48,
    modulus_error: Annotated[float, Interval(ge=0, le=1)] = 0.0,
    cell_px: Annotated[int, Interval(ge=1, le=8)] = CELL_PX,
    largest: LargestContacts,
) -> PressForce:
    """Find the pressure, inside the contacts only, whose displacement of the layer is the height.

    The gel is an elastic layer bonded to its window (`elastic_layer`); its response is diagonal
    in the cosine transform.  The height's error is that of integrated slopes, k times smaller at
    the wave number k, and its mean means nothing; so the misfit is weighted by k^2: least squares,
    by conjugate gradients over the cells of the contacts.  A zero or a tilt of the height that is
    wrong hardly matters.

    Parameters
    ----------
    height : H x W in mm
    contact
        H x W, the number of the contact at each pixel, as `find_contact` gives it: outside there
        is no pressure, and inside it may come out below zero by noise.
    pixel : mm per px
    error
        H x W, the height's standard deviation in mm; without it forces have no deviation.  With
        it they have that of the height, of what it departs from the layer's where film hangs free,
        and of the modulus.
    view : the calibration, for the lens and the camera's height; None: an even grid
    modulus_kpa : Young's modulus of the gel
    thickness_mm : of the gel, between film and window
    poisson : Poisson's ratio; 0.5 cannot be compressed
    modulus_error : relative standard deviation of the modulus
    cell_px : side of the cells that have a pressure of their own
    most : largest number of contacts that have figures, the largest; all press

    Returns
    -------
    Pressure H x W in kPa, and for each contact ``contact_force_n/c1``, its standard deviation
    ``contact_force_sd_n/c1``, the highest pressure ``contact_pressure_kpa/c1``, and the force's
    centre in px, ``contact_force_x_px/c1``, ``contact_force_y_px/c1``.
    """
    warn_of_limits(height, contact, thickness_mm)
    layer = pressed_layer(height.shape, pixel, cell_px, modulus_kpa, thickness_mm, poisson)
    found = press_on(layer, height, contact, pixel, error, view or View(), largest)
    for name in [name for name in found.figures if name.startswith("contact_force_sd_n/")]:
        by_modulus = modulus_error * found.figures[name.replace("_sd_", "_")]
        found.figures[name] = float(np.hypot(found.figures[name], by_modulus))
    return found


def press_on(
    layer: PressedLayer,
    height: Height,
    contact: Contacts,
    pixel: float,
    error: HeightError | None,
    view: View,
    largest: LargestContacts,
) -> PressForce:
    """Find the pressure on a layer of known modulus."""
    cell_px = layer.side
    numbers = largest.numbers(contact)
    place = _Place(height, view)
    touched = place.cells(contact > 0, cell_px)
    cells = layer.pressed(place.cells(height, cell_px), touched)
    size = touched.shape[1] * cell_px, touched.shape[0] * cell_px
    enlarged = np.asarray(
        cv2.resize(cells.pressure, size, interpolation=cv2.INTER_LINEAR), np.float32
    )
    apparent = place.apparent(enlarged[: height.shape[0], : height.shape[1]])
    pressure = np.where(contact > 0, apparent, np.float32(0))
    figures = _figures(pressure, contact, numbers, pixel**2 * place.areas)
    if error is not None:
        stated, misfit = place.cells(error, cell_px), layer.misfit(cells)
        for name in [name for name in figures if name.startswith("contact_force_n/")]:
            number = int(name.rpartition("/c")[2])
            part = cells.inside * place.cells(contact == number, cell_px)
            by_height = layer.sensitivity(cells.inside, part)
            causes = (
                force_deviation(by_height * stated, layer.k),
                float((by_height * misfit).sum()),
            )
            by_causes = NEWTONS_PER_KPA_MM2 * layer.cell_mm**2 * np.hypot(*causes)
            figures[f"contact_force_sd_n/c{number}"] = float(by_causes)
    return PressForce(pressure, figures)


class _Place:
    """Where on the film the pixels of a camera look, and back; nowhere else on an even grid."""

    def __init__(self, height: Height, view: View) -> None:
        self._height, self._view = height, view
        self._places: tuple[NDArray[Any], NDArray[Any]] | None = None
        self.areas: NDArray[Any] = np.ones((1, 1))
        if not view.is_plain:
            self._places = x, y = view.places(height)
            (x_down, x_right), (y_down, y_right) = np.gradient(x), np.gradient(y)
            self.areas = x_right * y_down - x_down * y_right

    def cells(self, plane: NDArray[Any], side: int) -> F4:
        """A map as seen, on cells of an even grid on the film; 0 where no pixel sees it."""
        plane = plane.astype(np.float32)
        if self._places is not None:
            _, (plane,) = self._view.on_even_grid(self._height, [plane])
        return np.asarray(coarsen(np.nan_to_num(plane)[None], factor=side)[0])

    def apparent(self, plane: F4) -> F4:
        """A map on an even grid, as seen."""
        if self._places is None:
            return plane
        rows, columns = plane.shape
        x, y = (
            (place + (size - 1) / 2).astype(np.float32)
            for place, size in zip(self._places, (columns, rows), strict=True)
        )
        return np.asarray(cv2.remap(plane, x, y, cv2.INTER_LINEAR))


def _figures(
    pressure: F4, contact: Contacts, numbers: NDArray[np.intp], area: NDArray[Any]
) -> dict[str, float]:
    """Figures of contacts; `area` is that of a pixel in mm^2."""
    figures: dict[str, float] = {}
    load = pressure * area
    for number in numbers:
        y, x = np.nonzero(contact == number)
        part = load[y, x]
        total = float(part.sum())
        figures[f"contact_force_n/c{number}"] = NEWTONS_PER_KPA_MM2 * total
        figures[f"contact_pressure_kpa/c{number}"] = float(pressure[y, x].max(initial=0))
        if total > 0:
            figures[f"contact_force_x_px/c{number}"] = float(x @ part) / total
            figures[f"contact_force_y_px/c{number}"] = float(y @ part) / total
    return figures


def depth_of(height: Height, contact: Contacts) -> float:
    """How far the film is pressed in, in mm."""
    return float(np.max(height, initial=0, where=contact > 0))


def warn_of_limits(height: Height, contact: Contacts, thickness: float) -> None:
    """Warn of a press that is too deep for a linear layer, or that the frame cuts."""
    deepest = depth_of(height, contact)
    if deepest >= thickness:
        warn(
            f"the film is pressed in by {deepest:.2g} mm, but the gel is {thickness:g} mm thick: "
            "`thickness_mm` or the height is wrong, and so are forces"
        )
    elif deepest > MAX_STRAIN * thickness:
        warn(
            f"the film is pressed in by {deepest:.2g} mm of {thickness:g}: the gel's response is "
            "no longer linear there, and forces come out too small"
        )
    border = np.concatenate([contact[0], contact[-1], contact[:, 0], contact[:, -1]])
    if np.count_nonzero(border) > MAX_BORDER_SHARE * np.count_nonzero(contact):
        warn("a contact reaches the image's border: its force is that of the part in view")
