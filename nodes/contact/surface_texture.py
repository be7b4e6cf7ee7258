"""Surface texture of what is pressed against the film (ISO 25178)."""

from __future__ import annotations

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import node, warn
from tactograph.nodes import Contacts, Height, Metrics, PixelSize
from tactograph.nodes.contact._areal_surface import areal_surface

POINTS_PER_TERM = 10
"""Fewer points than so many for each term of the form would be its shape, not the surface's."""
LEVEL_UM = 1e-6
"""Heights that depart less from the form have no skewness: they are rounding."""


@node
def surface_texture(
    height: Height,
    pixel: PixelSize,
    contact: Contacts | None = None,
    *,
    form_degree: Annotated[int, Interval(ge=0, le=8)] = 1,
    edge_px: Annotated[int, Interval(ge=0, le=50)] = 4,
) -> Metrics:
    """Return Sa, Sq, Sz, Ssk and Sku of ISO 25178-2, of each contact or of the whole map.

    The form is taken off by least squares, then surfalize evaluates the heights that are left.
    No filter is applied: the film is one (it bridges what is finer than its own thickness), and
    so are the pixels.  What is not known, NaN, is left out of form and figures, not filled.

    Parameters
    ----------
    height
        H x W in mm.
    pixel
        mm per px.
    contact
        H x W, the number of the contact at each pixel, as `find_contact` gives it; else all of
        the map is one surface.
    form_degree
        Of the polynomial in x and y that is the form: 0 the mean, 1 a plane (levelling), 2 a
        ball or a cylinder, too.
    edge_px
        Pixels along the border of a contact that are left out: there the film bends.

    Returns
    -------
    dict
        ``Sa_um``, the mean departure from the form, ``Sq_um``, its root mean square, ``Sz_um``,
        from the lowest to the highest point; ``Ssk`` and ``Sku``, skewness and kurtosis, where
        the surface is not exactly its form; ``texture_area_mm2``, what was evaluated.  Of
        contacts each its own: ``Sa_um/c1`` ...  A surface of too few points has an area alone,
        and a warning says so.

    Raises
    ------
    InputError
        If surfalize is not installed (``pip install tactograph[metrology]``).
    """
    known = np.isfinite(height)
    if contact is None:
        return _texture(height, known, pixel, form_degree, "the height map")
    figures: Metrics = {}
    for number in range(1, int(contact.max(initial=0)) + 1):
        inside = _without_edge((contact == number).astype(np.uint8), edge_px) & known
        found = _texture(height, inside, pixel, form_degree, f"contact {number}")
        figures |= {f"{name}/c{number}": figure for name, figure in found.items()}
    return figures


def _without_edge(mask: NDArray[np.uint8], edge: int) -> NDArray[np.bool_]:
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * edge + 1, 2 * edge + 1))
    # What lies beyond the picture bends nothing.
    return np.asarray(cv2.erode(mask, element) > 0)


def _texture(
    height: Height, inside: NDArray[np.bool_], pixel: float, degree: int, name: str
) -> Metrics:
    count = int(inside.sum())
    figures: Metrics = {"texture_area_mm2": count * pixel**2}
    terms = (degree + 1) * (degree + 2) // 2
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    if count < POINTS_PER_TERM * terms or min(len(rows), len(columns)) < degree + 2:
        warn(
            f"surface_texture: {name} has {count} points on {len(rows)} rows and {len(columns)} "
            f"columns, too few for a form of degree {degree}: no figures"
        )
        return figures
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    used = inside[part]
    surface = areal_surface(np.where(used, height[part], np.float32(0)), pixel, ~used)
    with np.errstate(divide="ignore", invalid="ignore"):  # of a surface that is its form
        found = surface.detrend_polynomial(degree).height_parameters()
    figures |= {f"{each}_um": float(found[each]) for each in ("Sa", "Sq", "Sz")}
    if found["Sq"] > LEVEL_UM:
        figures |= {each: float(found[each]) for each in ("Ssk", "Sku")}
    return figures
