"""Poses of many touches from the motions between pairs: a pose graph, by least squares."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tactograph.rings.mechanics.nodes.motion._rigid_fit import Fit
from tactograph.rings.mechanics.nodes.motion._surface import six_numbers, small_motion
from tactograph.sdk import F8

MIN_PAIR_VARIANCE = np.array([2e-3, 2e-3, 1e-2, 2e-3, 2e-3, 1e-3]) ** 2
"""Least variance of a pair in mm^2 and rad^2: the scatter lacks errors common to a film."""
MAX_APART = 5.0
"""Standard deviations by which a pair may miss the poses before it counts as false."""


class Pair(NamedTuple):
    """Two touches, and the motion that takes the first's coordinates to the second's."""

    first: int
    second: int
    fit: Fit


def solve_poses(count: int, pairs: list[Pair]) -> tuple[dict[int, F8], list[Pair]]:
    """Poses 4 x 4 from each touch's coordinates to the root's, and the pairs that they rest on.

    The worst pair that misses the poses by more than `MAX_APART` goes, until none does; touches
    that no pair connects to the root have no pose.
    """
    pairs = list(pairs)
    while True:
        poses = _chained(count, pairs)
        kept = [pair for pair in pairs if pair.first in poses]
        if len(poses) < 2:
            return poses, kept
        poses = _adjusted(poses, kept)
        apart = [float(np.linalg.norm(_missed(poses, pair))) / np.sqrt(6) for pair in kept]
        if max(apart) < MAX_APART:
            return poses, kept
        pairs.remove(kept[int(np.argmax(apart))])


def _chained(count: int, pairs: list[Pair]) -> dict[int, F8]:
    """Poses along the pairs that share most (Prim), from the touch with the most pairs."""
    degree = np.bincount([end for pair in pairs for end in pair[:2]], minlength=count)
    poses = {int(np.argmax(degree)): np.eye(4)}
    while True:
        edges = [pair for pair in pairs if (pair.first in poses) != (pair.second in poses)]
        if not edges:
            return poses
        first, second, fit = max(edges, key=lambda pair: pair.fit.overlap * pair.fit.likeness)
        if first in poses:
            poses[second] = poses[first] @ np.linalg.inv(fit.motion)
        else:
            poses[first] = poses[second] @ fit.motion


def _missed(poses: dict[int, F8], pair: Pair) -> F8:
    """Departure of the poses from a pair's motion, in standard deviations."""
    motion = np.linalg.inv(poses[pair.second]) @ poses[pair.first]
    step = six_numbers(motion @ np.linalg.inv(pair.fit.motion))
    spread = np.linalg.cholesky(pair.fit.covariance + np.diag(MIN_PAIR_VARIANCE))
    return np.asarray(np.linalg.solve(spread, step))


def _adjusted(poses: dict[int, F8], pairs: list[Pair]) -> dict[int, F8]:
    """Least squares over all poses but the root's; pairs that miss lose weight (Cauchy)."""
    root, *others = poses

    def moved(steps: F8) -> dict[int, F8]:
        shifts = zip(others, steps.reshape(-1, 6), strict=True)
        return {root: poses[root]} | {n: small_motion(step) @ poses[n] for n, step in shifts}

    def missed(steps: F8) -> F8:
        now = moved(steps)
        return np.concatenate([_missed(now, pair) for pair in pairs])

    solution = least_squares(missed, np.zeros(6 * len(others)), loss="cauchy", x_scale="jac")
    return moved(solution.x)
