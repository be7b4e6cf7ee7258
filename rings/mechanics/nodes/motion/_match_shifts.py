"""Possible places of one touched surface on another: masked correlation of curvatures.

D. Padfield, "Masked object registration in the Fourier domain", 2012.  Curvature does not change
when a surface turns about z or is shifted; turns are tried one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

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


class Match(NamedTuple):
    """How unlikely by chance two surfaces are alike, and motions that may lead from one to the
    other, 4 x 4: shifts in the film's plane and turns about z, the likeliest first."""

    score: float
    motions: list[F8]


class Spectra:
    """A surface for correlations with others of its size.

    Parameters
    ----------
    surface : H x W cells
    """

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self.inner = int(np.count_nonzero(_inner(surface)))
        self._size = [next_fast_len(2 * n, real=True) for n in surface.height.shape]
        self.level = self._turned(0.0)

    def _turned(self, turn: float) -> list[NDArray[Any]]:
        return _transforms(self._surface, turn, self._size)

    def matches(
        self, others: Sequence[Spectra], turn_deg: float, least_overlap: float
    ) -> list[Match]:
        """Match this surface, turned step by step, with each of the others."""
        turns = int(turn_deg / STEP_DEG)
        candidates_by_surface: list[list[tuple[float, F8]]] = [[] for _ in others]
        for turn in np.arange(-turns, turns + 1) * STEP_DEG if others else ():
            turned = [plane.conj() for plane in self._turned(float(turn))]
            for other, candidates in zip(others, candidates_by_surface, strict=True):
                least = least_overlap * min(self.inner, other.inner)
                score, (x, y) = self._shift(turned, other, max(least, 1))
                motion = small_motion(np.array([x, y, 0, 0, 0, np.radians(turn)]))
                candidates.append((score, motion))
        return [self._likeliest(candidates) for candidates in candidates_by_surface]

    def _shift(
        self, turned: list[NDArray[Any]], other: Spectra, least: float
    ) -> tuple[float, list[float]]:
        """The shift in mm at which a turned surface is most like another."""
        size, side = self._size, self._surface.side
        overlap, alike, mine, its = (
            irfft2(turned[a] * other.level[b], size) for a, b in ((0, 0), (1, 1), (2, 0), (0, 2))
        )
        # Correlation times the root of what overlaps: how unlikely it is by chance.
        sure = alike / np.sqrt(np.maximum(mine * its, 1e-9)) * np.sqrt(np.maximum(overlap, 0))
        sure[overlap < least] = 0
        y, x = np.unravel_index(int(np.argmax(sure)), sure.shape)
        shift = [float(n - m if n > m / 2 else n) * side for n, m in ((x, size[1]), (y, size[0]))]
        return float(sure[y, x]), shift

    def _likeliest(self, candidates: list[tuple[float, F8]]) -> Match:
        motions: list[F8] = []
        ordered = sorted(candidates, key=lambda each: -each[0])
        for _, motion in ordered:
            # Turns that lead to one shift lead to one fit.
            apart = [np.abs(motion - other)[:2, 3].max() for other in motions]
            if min(apart, default=np.inf) > MIN_SHIFT_CELLS * self._surface.side:
                motions.append(motion)
        return Match(ordered[0][0], motions[:MAX_GUESSES])


def resolves(surface: Surface) -> bool:
    """Return whether the cells are small enough for the contacts, which may be many small ones."""
    return _inner(surface).sum() >= MIN_INNER_SHARE * np.count_nonzero(surface.touched)


def _inner(surface: Surface) -> F4:
    """Touched cells whose curvature is not that of a rim, as 0 and 1."""
    return np.asarray(cv2.erode(surface.touched.astype(np.float32), RIM_ELEMENT, borderValue=0))


def _transforms(surface: Surface, turn: float, size: list[int]) -> list[NDArray[Any]]:
    """Spectra of the mask of touched cells, their curvature, and its square, turned about the
    middle."""
    touched = surface.touched.astype(np.float32)
    height, share = (
        cv2.GaussianBlur(plane, (0, 0), SMOOTH_CELLS)
        for plane in (np.nan_to_num(surface.height), touched)
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
