"""Poses of many touches from the motions between pairs: a pose graph, by least squares."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
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


class Solved(NamedTuple):
    """Poses 4 x 4 from each touch's coordinates to the root's, and what they rest on."""

    poses: dict[int, F8]
    pairs: list[Pair]
    covariances: dict[int, F8]
    """6 x 6 of a small motion (mm, rad) after each pose."""


def solve_poses(count: int, pairs: list[Pair]) -> Solved:
    """Return the poses of all touches that pairs connect to the root.

    The worst pair that misses the poses by more than `MAX_APART` goes, until none does; touches
    that no pair connects to the root have no pose.
    """
    pairs = list(pairs)
    while True:
        poses = _chained(count, pairs)
        kept = [pair for pair in pairs if pair.first in poses]
        if len(poses) < 2:
            return Solved(poses, kept, {})
        poses, covariances = _adjusted(poses, kept)
        apart = [float(np.linalg.norm(_missed(poses, pair))) / np.sqrt(6) for pair in kept]
        if max(apart) < MAX_APART:
            return Solved(poses, kept, covariances)
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
    return np.asarray(np.linalg.solve(_spread(pair), step))


def _spread(pair: Pair) -> F8:
    return np.linalg.cholesky(pair.fit.covariance + np.diag(MIN_PAIR_VARIANCE))


def _spread_at_height(pair: Pair) -> F8:
    """A root of a pair's covariance where z is known: touches that overlap agree in height, and
    what their heights err by is stated already."""
    others, whole = [0, 1, 3, 4, 5], pair.fit.covariance
    by_z = whole[others, 2] / whole[2, 2]
    root = np.zeros((6, 6))
    given_z = whole[np.ix_(others, others)] - np.outer(by_z, whole[2, others])
    root[np.ix_(others, others)] = np.linalg.cholesky(given_z)
    return root


def _adjusted(poses: dict[int, F8], pairs: list[Pair]) -> tuple[dict[int, F8], dict[int, F8]]:
    """Least squares over all poses but the root's; pairs that miss lose weight (Cauchy).

    The second are the poses' covariances, of pairs that scatter as their fits say.
    """
    root, *others = poses

    def moved(steps: F8) -> dict[int, F8]:
        shifts = zip(others, steps.reshape(-1, 6), strict=True)
        return {root: poses[root]} | {n: small_motion(step) @ poses[n] for n, step in shifts}

    def missed(steps: F8) -> F8:
        now = moved(steps)
        return np.concatenate([_missed(now, pair) for pair in pairs])

    solution = least_squares(missed, np.zeros(6 * len(others)), loss="cauchy", x_scale="jac")
    by_pair = np.linalg.pinv(solution.jac)
    whitened = [np.linalg.solve(_spread(p), _spread_at_height(p)) for p in pairs]
    root_of_it = (by_pair @ block_diag(*whitened)).reshape(len(others), 6, -1)
    found = {n: half @ half.T for n, half in zip(others, root_of_it, strict=True)}
    return moved(solution.x), {root: np.zeros((6, 6))} | found
