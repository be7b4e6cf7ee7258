"""Find the markers that are printed on a film."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Interval
from scipy.ndimage import center_of_mass

from tactograph.rings.mechanics.nodes.marker.marker_darkness import Darkness
from tactograph.sdk import F4, Port, node

Markers = Annotated[F4, Port("M 3", "px")]
"""x, y and the radius of a disk of the same area, a row for each marker."""


@node
def find_markers(
    darkness: Darkness,
    *,
    dark: Annotated[float, Interval(ge=0.01, le=1)] = 0.15,
    smallest_px: Annotated[int, Ge(1)] = 4,
    largest_px: Annotated[int, Ge(1)] = 1000,
) -> Markers:
    """Return every dark spot's centroid, weighted by its darkness, and its size.

    Spots on the border of the frame are left out: part of them is not seen.

    Parameters
    ----------
    darkness : H x W, as `marker_darkness` gives it
    dark : darkness that all pixels of a spot exceed
    smallest_px, largest_px : smallest and largest area of a marker

    Returns
    -------
    M x 3: x, y, radius in px; rows from the top of the frame down.
    """
    rows, columns = darkness.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        (darkness > dark).astype(np.uint8), connectivity=8
    )
    left, top, wide, high, area = stats[:, :5].T
    inside = (left > 0) & (top > 0) & (left + wide < columns) & (top + high < rows)
    is_marker = inside & (area >= smallest_px) & (area <= largest_px)
    is_marker[0] = False
    spots = np.flatnonzero(is_marker)
    # The skirt of a spot counts, too: if it is cut off at the threshold, the centroid jumps.
    grown = np.asarray(cv2.dilate(labels.astype(np.uint16), np.ones((3, 3), np.uint8)), np.intp)
    places = np.reshape(center_of_mass(darkness.astype(np.float64), grown, spots), (-1, 2))
    return np.column_stack([places[:, ::-1], np.sqrt(area[spots] / np.pi)]).astype(np.float32)
