"""The centres of dark or bright dots."""

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tactograph.rings.camera.nodes._lattice import MIN_POINTS, Lattice, neighbours, on_lattice
from tactograph.sdk import F4

MAX_SEARCH_SIDE_PX = 800
"""Longest side in px of the image in which dots are searched for; the full one measures them."""
BACKGROUND_SCALES = (1 / 40, 1 / 20, 1 / 10, 1 / 5)
"""Scales of the background, relative to the image's longer side; the one that suits is used."""
MIN_DOT_PIXELS = 7
"""Smallest area of a dot in pixels."""
MAX_COVERED_SHARE = 0.4
"""Largest share of the film under dots; dots that touch are squares of a checkerboard."""

Points = NDArray[Any]


class Blobs(NamedTuple):
    """Round blobs of one size in a small image: centres, radius, and 1 if bright, -1 if dark."""

    place: Points
    radius: float
    sign: int


def reduced(image: F4) -> tuple[F4, int]:
    """The image reduced to at most `MAX_SEARCH_SIDE_PX` px, and the factor."""
    factor = -(-max(image.shape) // MAX_SEARCH_SIDE_PX)
    small = cv2.resize(image, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32), factor


class Dots(NamedTuple):
    """Dots on one lattice, and M x 2 places in px of whole dots that are not on it."""

    lattice: Lattice
    astray: Points


def find_dots(image: F4) -> Dots | None:
    """Return the dots that lie on one lattice; None if there are not enough."""
    small, factor = reduced(image)
    rough, blobs = None, None
    for part in BACKGROUND_SCALES:
        for candidates in _blobs(small, part):
            lattice = on_lattice(candidates.place)
            if lattice and (rough is None or len(lattice.place) > len(rough.place)):
                rough, blobs = lattice, candidates
    if rough is None or blobs is None:
        return None
    places = factor * (rough.place + 0.5) - 0.5
    centres = [_centre(image, place, factor * blobs.radius, blobs.sign) for place in places]
    lattice = on_lattice(np.array([c for c in centres if c is not None]))
    if lattice is None:
        return None
    radius = factor * blobs.radius
    every = factor * (blobs.place + 0.5) - 0.5
    whole = every[_is_whole(every, radius, image.shape)]
    away, _ = KDTree(lattice.place).query(whole)
    return Dots(lattice, whole[away > radius])


def _is_whole(places: Points, radius: float, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return whether the frame cuts off nothing of dots, nor of their blurred edges."""
    last = np.array([shape[1] - 1, shape[0] - 1])
    return np.asarray(np.minimum(places, last - places).min(axis=-1) >= radius + 1)


def _blobs(image: F4, part: float) -> list[Blobs]:
    """Dark and bright blobs, after division by the background of scale `part`."""
    around = cv2.GaussianBlur(image, (0, 0), part * max(image.shape))
    even = image / np.maximum(around, np.float32(1e-3))
    levels = np.clip(100 * even, 0, 255).astype(np.uint8)
    _, bright = cv2.threshold(levels, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    above = np.asarray(bright, np.uint8)
    polarities = [Blobs(*_round_blobs(255 - above), -1), Blobs(*_round_blobs(above), 1)]
    return [blobs for blobs in polarities if _is_sparse(blobs)]


def _round_blobs(blobs: NDArray[np.uint8]) -> tuple[Points, float]:
    """Centres of round blobs of the usual size that the frame does not cut off; their radius."""
    _, _, stats, centres = cv2.connectedComponentsWithStats(blobs, connectivity=4)
    stats, centres = stats[1:], centres[1:]
    x, y, width, height, area = stats.T
    rows, columns = blobs.shape
    whole = (x > 0) & (y > 0) & (x + width < columns) & (y + height < rows)
    is_round = (width < 1.6 * height) & (height < 1.6 * width)
    filled = area / np.maximum(width * height, 1)
    is_dot = whole & is_round & (filled > 0.55) & (filled < 0.97) & (area >= MIN_DOT_PIXELS)
    if not is_dot.any():
        return np.empty((0, 2)), 0.0
    # The median by area instead of by number, so that specks do not count.
    sizes = np.sort(area[is_dot])
    usual = sizes[np.searchsorted(np.cumsum(sizes), sizes.sum() / 2)]
    is_dot &= (area > 0.5 * usual) & (area < 2 * usual)
    return centres[is_dot], float(np.sqrt(usual / np.pi))


def _is_sparse(blobs: Blobs) -> bool:
    if len(blobs.place) < MIN_POINTS:
        return False
    gaps, _ = neighbours(blobs.place, 1)
    return bool(np.pi * blobs.radius**2 < MAX_COVERED_SHARE * np.median(gaps) ** 2)


def _centre(image: F4, place: Points, radius: float, sign: int) -> Points | None:
    """The centre of mass of a dot's contrast against a plane fitted to its surroundings.

    None if the frame cuts off the dot, or the centre drifts away.
    """
    reach = 1.5 * radius + 1.5
    rows, columns = image.shape
    start = place
    if not _is_whole(start, radius, image.shape):
        return None
    for _ in range(3):
        x0, y0 = np.maximum(np.floor(place - reach).astype(int), 0)
        x1, y1 = np.minimum(np.ceil(place + reach).astype(int) + 1, (columns, rows))
        y, x = np.mgrid[y0:y1, x0:x1]
        dx, dy = x - place[0], y - place[1]
        distance = np.hypot(dx, dy)
        around = (distance > 1.2 * radius + 1) & (distance <= reach)
        terms = np.stack([np.ones(dx.shape), dx, dy], axis=-1)
        window = image[y0:y1, x0:x1].astype(np.float64)
        plane = terms @ np.linalg.lstsq(terms[around], window[around], rcond=None)[0]
        contrast = sign * (window / np.maximum(plane, 1e-3) - 1)
        inside = distance <= 1.2 * radius + 1
        mass = contrast[inside].sum()
        if mass <= 0:
            return None
        place = place + [(contrast * d)[inside].sum() / mass for d in (dx, dy)]
        if np.hypot(*(place - start)) > radius:
            return None
    return place
