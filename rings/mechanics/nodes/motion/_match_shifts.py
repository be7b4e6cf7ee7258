"""Possible places of one touched surface on another: masked correlation of curvatures.

D. Padfield, "Masked object registration in the Fourier domain", 2012.  Curvature does not change
when a surface turns about z or is shifted; turns are tried one by one.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2

from tactograph.rings.mechanics.nodes.motion._surface import Surface, small_motion
from tactograph.sdk import F4, F8

STEP_DEG = 3.0
SMOOTH_CELLS = 1.0
RIM_ELEMENT = np.ones((5, 5), np.uint8)
"""Cells around one that are touched where its curvature is the object's."""
MIN_INNER_SHARE = 0.4
"""Share of the touched cells that are no rim's, from which the cells resolve the contacts."""
MAX_GUESSES = 4
"""Most motions tried per pair."""
MIN_SHIFT_CELLS = 3
"""Cells between the shifts of two of them."""


def likely_motions(
    first: Surface, second: Surface, turn_deg: float, least_overlap: float
) -> list[F8]:
    """Motions 4 x 4, shifts in the film's plane and turns about z, the likeliest first."""
    candidates = []
    size = [next_fast_len(2 * n, real=True) for n in first.height.shape]
    others = _transforms(second, 0.0, size)
    least = least_overlap * min(np.count_nonzero(_inner(s)) for s in (first, second))
    turns = int(turn_deg / STEP_DEG)
    for turn in np.arange(-turns, turns + 1) * STEP_DEG:
        one = [plane.conj() for plane in _transforms(first, float(turn), size)]
        overlap, alike, mine, its = (
            irfft2(one[a] * others[b], size) for a, b in ((0, 0), (1, 1), (2, 0), (0, 2))
        )
        # Correlation times the root of what overlaps: how unlikely it is by chance.
        sure = alike / np.sqrt(np.maximum(mine * its, 1e-9)) * np.sqrt(np.maximum(overlap, 0))
        sure[overlap < max(least, 1)] = 0
        y, x = np.unravel_index(int(np.argmax(sure)), sure.shape)
        shift = [(n - m if n > m / 2 else n) * first.side for n, m in ((x, size[1]), (y, size[0]))]
        motion = small_motion(np.array([*shift, 0, 0, 0, np.radians(turn)]))
        candidates.append((float(sure[y, x]), motion))
    guesses: list[F8] = []
    for _, motion in sorted(candidates, key=lambda each: -each[0]):
        # Turns that lead to one shift lead to one fit.
        if all(
            np.abs(motion - guess)[:2, 3].max() > MIN_SHIFT_CELLS * first.side for guess in guesses
        ):
            guesses.append(motion)
    return guesses[:MAX_GUESSES]


def resolves(surface: Surface) -> bool:
    """Return whether the cells are small enough for the contacts, which may be many small ones."""
    return _inner(surface).sum() >= MIN_INNER_SHARE * np.count_nonzero(surface.touched)


def _inner(surface: Surface) -> F4:
    """Touched cells whose curvature is not that of a rim, as 0 and 1."""
    return np.asarray(cv2.erode(surface.touched.astype(np.float32), RIM_ELEMENT, borderValue=0))


def _transforms(surface: Surface, turn: float, size: list[int]) -> list[NDArray[Any]]:
    """Spectra of the mask of touched cells, their curvature, and its square, turned about the
    middle."""
    seen = surface.touched.astype(np.float32)
    height, share = (
        cv2.GaussianBlur(plane, (0, 0), SMOOTH_CELLS)
        for plane in (np.nan_to_num(surface.height), seen)
    )
    curved = cv2.Laplacian(height / np.maximum(share, np.float32(0.1)), cv2.CV_32F)
    inner = _inner(surface)
    rows, columns = inner.shape
    # OpenCV's angles are positive against the clock; here from x to y.
    place = cv2.getRotationMatrix2D(((columns - 1) / 2, (rows - 1) / 2), -turn, 1)
    mask = cv2.warpAffine(inner, place, (columns, rows)) > 0.99
    plane = cv2.warpAffine(curved, place, (columns, rows))
    plane = np.where(mask, plane - (plane[mask].mean() if mask.any() else 0), 0)
    return [rfft2(p, size) for p in (mask.astype(np.float32), plane, plane**2)]
