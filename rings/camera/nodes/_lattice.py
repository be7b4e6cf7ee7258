"""Lattice coordinates of points on a square lattice that a lens may distort."""

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

MIN_POINTS = 12
"""Fewest points on the lattice; three rows and columns are needed, too."""
MAX_OFFSET_PITCHES = 0.25
"""Largest distance of a neighbour from its predicted position, relative to the pitch."""
STARTING_POINTS = 25
"""Points around the first one, five rows and columns, that tell its step."""
LATTICE_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))

Points = NDArray[Any]


class Lattice(NamedTuple):
    """N points in px, and their columns and rows."""

    place: Points
    cell: NDArray[np.int32]

    @property
    def pitch(self) -> float:
        """The distance between neighbours in px."""
        distances, _ = neighbours(self.place, 1)
        return float(np.median(distances))

    @property
    def gaps(self) -> int:
        """The number of places without a point, between points in their row and their column."""
        first = self.cell.min(axis=0)
        occupied = np.zeros(np.ptp(self.cell, axis=0) + 1, bool)
        occupied[tuple((self.cell - first).T)] = True
        sides = (
            np.flip(np.logical_or.accumulate(np.flip(occupied, end), axis=axis), end)
            for axis in (0, 1)
            for end in ((), axis)
        )
        return int((np.logical_and.reduce([*sides]) & ~occupied).sum())


def neighbours(points: Points, count: int) -> tuple[Points, NDArray[np.intp]]:
    """Distances and numbers of the nearest other points, N x `count` each."""
    nearest: Any = KDTree(points).query(points, k=count + 1)
    return nearest[0][:, 1:], nearest[1][:, 1:]


def on_lattice(points: Points) -> Lattice | None:
    """Number the points that lie on one square lattice, from neighbour to neighbour.

    The first axis of the lattice is the one nearest to the image's rows.  Each step is predicted
    from the previous one in the same direction, so that the lattice may bend.
    """
    if len(points) < MIN_POINTS:
        return None
    tree = KDTree(points)
    start = int(np.argmin(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
    # A strong lens makes the middle's pitch far larger than the typical one.
    _, around = tree.query(points[start], k=min(STARTING_POINTS, len(points)))
    step = _step(points[around])
    cells = {start: (0, 0)}
    occupied = {(0, 0)}
    queue = deque([(start, step, np.array([-step[1], step[0]]))])
    while queue:
        at, along, down = queue.popleft()
        for i, j in LATTICE_STEPS:
            want = i * along + j * down
            distance, nearest = tree.query(points[at] + want)
            near, place = int(nearest), (cells[at][0] + i, cells[at][1] + j)
            if (
                near in cells
                or place in occupied
                or distance > MAX_OFFSET_PITCHES * np.hypot(*want)
            ):
                continue
            cells[near] = place
            occupied.add(place)
            went = (points[near] - points[at]) * (i + j)
            queue.append((near, went, down) if i else (near, along, went))
    which = np.array(list(cells))
    cell = np.array([cells[n] for n in which], np.int32)
    if len(which) < MIN_POINTS or min(len(np.unique(axis)) for axis in cell.T) < 3:
        return None
    return Lattice(points[which], cell)


def _step(points: Points) -> Points:
    """The typical step to a neighbour, rotated by quarter turns to lie nearest to the rows."""
    distances, near = neighbours(points, 4)
    steps = (points[near] - points[:, None])[distances < 1.25 * np.median(distances[:, 0])]
    angle = np.angle(np.mean(np.exp(4j * np.arctan2(steps[:, 1], steps[:, 0])))) / 4
    usual: Points = np.median(np.linalg.norm(steps, axis=1)) * np.array(
        [np.cos(angle), np.sin(angle)]
    )
    return usual
