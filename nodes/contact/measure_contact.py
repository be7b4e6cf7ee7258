"""Measure the size, depth and position of each contact."""

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node, warn
from tactograph.nodes import Contacts, Height, Metrics, PixelSize, RestHeight
from tactograph.nodes.contact.find_contact import MAX_CONTACTS
from tactograph.nodes.contact.largest_contacts import LargestContacts
from tactograph.nodes.height.distort_height import distort_height
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.optics.rest_shape import RestShape

PIXEL_VARIANCE = 1 / 12
"""Variance of positions within a square pixel, in px^2."""


@node
def measure_contact(
    height: Height,
    contact: Contacts,
    pixel: PixelSize,
    view: View | None = None,
    rest: RestHeight | None = None,
    *,
    largest: LargestContacts,
) -> Metrics:
    """Return area, depth, volume, position and principal axes of the largest contacts.

    The film rises as far as the object presses it in, so depth is height.

    Parameters
    ----------
    height : H x W in mm above the film at rest
    contact : H x W, the number of the contact at each pixel, from `find_contact`
    pixel : mm per px
    view : the calibration, for the lens and the camera's height; None: an even grid
    rest : R x C in mm on the even grid, the height of the film at rest; None: a plane
    most : largest number of contacts to measure; if there are more, a warning is given

    Returns
    -------
    dict
        ``contacts``, the number of all contacts, and for each measured contact, as
        ``contact_area_mm2/c1``, ``contact_area_mm2/c2`` ...:

        ``contact_area_mm2``, of the raised film, seen from above, which is more than the object
        touches, see ``docs/contact.md``; ``contact_depth_mm``, the greatest;
        ``contact_mean_depth_mm``; ``contact_volume_mm3``, between film and film at rest;
        ``contact_x_px``, ``contact_y_px``, the area's centroid, (0, 0) in the middle of the
        first pixel; ``contact_x_mm``, ``contact_y_mm``, the same from the centre of the
        image, x right, y down; ``contact_major_mm``, ``contact_minor_mm``, the axes (full
        lengths) of the ellipse that has the area's second moments;
        ``contact_angle_deg``, from x towards y to the major axis, above -90 up to 90;
        ``contact_cut``, whether it reaches the frame's border: then all figures are those of
        the visible part, and area, depth and volume are lower bounds.
    """
    view = view or View()
    numbers = LargestContacts(MAX_CONTACTS).numbers(contact)
    figures: Metrics = {"contacts": float(len(numbers))}
    if len(numbers) > largest.most:
        # Without their number, so that a stream warns once.
        warn(
            f"of all contacts (figure 'contacts') only the {largest.most} largest are "
            "measured; `most` sets how many"
        )
        numbers = largest.numbers(contact)
    shape = None
    if rest is not None:
        low = rest if view.lens is None else distort_height(rest, view.lens)
        shape = RestShape.of(low, pixel, view.camera or 0.0)
        figures["rest_relief_mm"] = float(np.ptp(shape.height))
    for number in numbers:
        mask = (contact == number).view(np.uint8)
        measured = _measured(height, mask, pixel, view)
        if shape is not None:
            measured |= _on_film(height, mask > 0, shape)
        figures |= {f"contact_{name}/c{number}": figure for name, figure in measured.items()}
    return figures


def _on_film(height: Height, mask: NDArray[np.bool_], shape: RestShape) -> Metrics:
    """The figures of one contact on a film that is not a plane at rest."""
    depth, low = height[mask].astype(np.float64), shape.height[mask].astype(np.float64)
    p, q = shape.slope[:, mask].astype(np.float64)
    longer, c = np.sqrt(1 + p * p + q * q), shape.camera
    side = shape.pixel * (1 - c * low)
    # The side of a pixel on the film grows with distance: 1 - c z times the side at height 0.
    share = 1 - c * depth / (1 - c * low)
    return {
        "volume_mm3": float((side * side * depth * (1 + share + share * share) / 3).sum()),
        "normal_depth_mm": float((depth / longer).max()),
        "film_area_mm2": float((side * side * longer).sum()),
    }


def _measured(height: Height, mask: NDArray[np.uint8], pixel: float, view: View) -> Metrics:
    """The figures of one contact: those of its pixels, transferred to the film by the lens."""
    left, top, width, rows = cv2.boundingRect(mask)
    part = slice(top, top + rows), slice(left, left + width)
    below, to_right = height.shape[0] - top - rows, height.shape[1] - left - width
    depth = height[part] * mask[part]
    # As bytes: cv2.moments would take two columns of floats for the corners of a polygon.
    moments = cv2.moments(mask[part])
    count = moments["m00"]
    x, y = left + moments["m10"] / count, top + moments["m01"] / count
    x_ideal, y_ideal = view.ideal(height.shape, x, y)
    stretch = view.ideal_steps(height.shape, x, y)
    shared = moments["mu11"] / count
    spread = np.array([[moments["mu20"] / count, shared], [shared, moments["mu02"] / count]])
    spread = stretch @ (spread + PIXEL_VARIANCE * np.eye(2)) @ stretch.T * pixel**2
    (minor, major), axes = np.linalg.eigh(spread)
    angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
    area = count * float(np.linalg.det(stretch)) * pixel**2
    # Film at a height h looks wider by 1 / (1 - h / D) (V1).
    near = depth * np.float32(view.camera or 0.0)
    mean = float((depth * (1 - near + near**2 / 3)).sum()) / count
    return {
        "area_mm2": area,
        "depth_mm": float(depth.max()),
        "mean_depth_mm": mean,
        "volume_mm3": mean * area,
        "x_px": x,
        "y_px": y,
        "x_mm": pixel * float(x_ideal),
        "y_mm": pixel * float(y_ideal),
        "major_mm": 4 * float(np.sqrt(major)),
        "minor_mm": 4 * float(np.sqrt(minor)),
        "angle_deg": float(90 - (90 - angle) % 180),
        "cut": min(left, top, below, to_right) == 0,
    }
