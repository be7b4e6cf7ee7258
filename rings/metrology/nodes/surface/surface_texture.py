"""Surface texture of what is pressed against the film (ISO 25178)."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.rings.metrology.nodes.surface.areal_surface import areal_surface
from tactograph.sdk import Contacts, Height, LargestContacts, PixelSize, node, warn

POINTS_PER_TERM = 10
"""Least number of points per term; with fewer the form would fit the surface's texture, too."""
MIN_SQ_UM = 1e-6
"""Heights that depart less from the form are rounding and have no skewness."""


@node
def surface_texture(
    height: Height,
    pixel: PixelSize,
    contact: Contacts | None = None,
    *,
    form_degree: Annotated[int, Interval(ge=0, le=8)] = 1,
    edge_px: Annotated[int, Interval(ge=0, le=50)] = 4,
    largest: LargestContacts,
) -> dict[str, float]:
    """Return Sa, Sq, Sz, Ssk and Sku of ISO 25178-2, of each contact or of the whole map.

    A form is fitted by least squares and subtracted; surfalize evaluates the remaining heights.
    No filter is applied: the film is one (it bridges what is finer than its own thickness), and
    so are the pixels.  Unknown heights (NaN) are excluded from form and figures, not filled.

    Parameters
    ----------
    height : H x W in mm above the film at rest
    pixel : mm per px
    contact
        H x W, the number of the contact at each pixel, as `find_contact` gives it; without it
        the whole map is one surface.
    form_degree
        Degree of the form, a polynomial in x and y: 0 is the mean, 1 a plane (levelling), 2 also
        a ball or a cylinder.
    edge_px : width in px of the border of a contact that is excluded, because the film bends there

    Returns
    -------
    dict
        ``Sa_um``, the mean departure from the form, ``Sq_um``, its root mean square, ``Sz_um``,
        from the lowest to the highest point; ``Ssk`` and ``Sku``, skewness and kurtosis, where
        the surface is not exactly its form; ``texture_area_mm2``, the area evaluated.  For
        contacts, one set each: ``Sa_um/c1`` ...  A surface of too few points has only an area,
        and gives a warning.

    Raises
    ------
    InputError
        If surfalize is not installed (``pip install 'tactograph[metrology]'``).
    """
    is_known = np.isfinite(height)
    if contact is None:
        return _texture(height, is_known, pixel, form_degree, "the height map")
    figures: dict[str, float] = {}
    for number in largest.numbers(contact):
        inside = _without_edge((contact == number).astype(np.uint8), edge_px) & is_known
        texture = _texture(height, inside, pixel, form_degree, f"contact {number}")
        figures |= {f"{name}/c{number}": figure for name, figure in texture.items()}
    return figures


def _without_edge(mask: NDArray[np.uint8], edge: int) -> NDArray[np.bool_]:
    element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * edge + 1, 2 * edge + 1))
    # At the border of the image the film does not bend.
    return np.asarray(cv2.erode(mask, element) > 0)


def _texture(
    height: Height, inside: NDArray[np.bool_], pixel: float, degree: int, name: str
) -> dict[str, float]:
    count = int(inside.sum())
    figures: dict[str, float] = {"texture_area_mm2": count * pixel**2}
    terms = (degree + 1) * (degree + 2) // 2
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    if count < POINTS_PER_TERM * terms or min(len(rows), len(columns)) < degree + 2:
        warn(
            f"{name} has {count} points on {len(rows)} rows and {len(columns)} "
            f"columns, too few for a form of degree {degree}: no figures"
        )
        return figures
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    used = inside[part]
    surface = areal_surface(np.where(used, height[part], np.float32(0)), pixel, ~used)
    with np.errstate(divide="ignore", invalid="ignore"):  # of a surface that is its form
        parameters = surface.detrend_polynomial(degree).height_parameters()
    figures |= {f"{each}_um": float(parameters[each]) for each in ("Sa", "Sq", "Sz")}
    if parameters["Sq"] > MIN_SQ_UM:
        figures |= {each: float(parameters[each]) for each in ("Ssk", "Sku")}
    return figures
