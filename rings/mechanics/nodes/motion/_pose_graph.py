"""Poses of many touches from the motions between pairs: a pose graph, by least squares."""

from typing import NamedTuple

import numpy as np

from tactograph.rings.mechanics.nodes.motion._rigid_fit import Fit
from tactograph.rings.mechanics.nodes.motion._surface import (
    carried,
    cross_matrix,
    six_numbers,
    small_motion,
)
from tactograph.sdk import F8

MIN_PAIR_VARIANCE = np.array([2e-3, 2e-3, 1e-2, 2e-3, 2e-3, 1e-3]) ** 2
"""Least variance of a pair in mm^2 and rad^2: the scatter lacks errors common to a film."""
MAX_APART = 5.0
"""Standard deviations by which a pair may miss the poses before it counts as false."""


MAX_STEPS = 100
"""Most Gauss-Newton steps."""
MIN_STEP_VARIANCE = 1e-8
"""Square of a step in its deviations; a shorter one is the last."""


class Pair(NamedTuple):
    """Two touches, and the motion that takes the first's coordinates to the second's."""

    first: int
    second: int
    fit: Fit


class Poses(NamedTuple):
    """Where touches lie, and the pairs that say so."""

    motions: dict[int, F8]
    """4 x 4, from each touch's coordinates to the root's; touches that no pair connects to the
    root have none."""
    covariances: dict[int, F8]
    """6 x 6 of a small motion after these (mm, rad)."""
    leans: dict[int, F8]
    """The same as pairs scatter, by what heights alone do not tell (`_leaning`)."""
    pairs: list[Pair]


def solve_poses(count: int, pairs: list[Pair]) -> Poses:
    """Poses of least squares over the pairs.

    The worst pair that misses the poses by more than `MAX_APART` goes, until none does.
    """
    pairs = list(pairs)
    while True:
        poses = _chained(count, pairs)
        connected = [pair for pair in pairs if pair.first in poses]
        if len(poses) < 2:
            return Poses(poses, {}, {}, connected)
        poses, covariances, leans = _adjusted(poses, connected)
        apart = [float(np.linalg.norm(_missed(poses, pair)[0])) / np.sqrt(6) for pair in connected]
        if max(apart) < MAX_APART:
            return Poses(poses, covariances, leans, connected)
        pairs.remove(connected[int(np.argmax(apart))])


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


def _missed(poses: dict[int, F8], pair: Pair) -> tuple[F8, F8]:
    """Departure of the poses from a pair's motion, in standard deviations, and its derivative by
    a small motion after the first pose, 6 x 6; by one after the second it is the negative."""
    back: F8 = np.asarray(np.linalg.inv(poses[pair.second]), np.float64)
    step = six_numbers(back @ poses[pair.first] @ np.linalg.inv(pair.fit.motion))
    spread, turned = _spread(pair), np.eye(6)
    turned[:3, 3:] = -cross_matrix(step[:3])
    both: F8 = np.asarray(
        np.linalg.solve(spread, np.column_stack([step, turned @ carried(back)])), np.float64
    )
    return both[:, 0], both[:, 1:]


def _spread(pair: Pair) -> F8:
    variance = pair.fit.covariance + np.diag(MIN_PAIR_VARIANCE)
    return np.asarray(np.linalg.cholesky(variance), np.float64)


def _leaning(pair: Pair) -> F8:
    """A root of a pair's covariance at a known z: touches that overlap agree in height, and what
    their heights err by is stated already."""
    whole, others = pair.fit.covariance, [0, 1, 3, 4, 5]
    at_z = whole - np.outer(whole[2], whole[2]) / whole[2, 2]
    root = np.zeros((6, 6))
    root[np.ix_(others, others)] = np.linalg.cholesky(at_z[np.ix_(others, others)])
    return root


def _adjusted(
    poses: dict[int, F8], pairs: list[Pair]
) -> tuple[dict[int, F8], dict[int, F8], dict[int, F8]]:
    """Gauss-Newton over all poses but the root's; pairs that miss lose weight (Cauchy).

    Also returned are covariances and leans, as `Poses` has them.
    """
    root, *others = poses
    place = {number: slice(6 * n, 6 * n + 6) for n, number in enumerate(others)}
    matrix = np.zeros((6 * len(others),) * 2)
    for _ in range(MAX_STEPS):
        matrix[:], gradient = 0, np.zeros(len(matrix))
        leaning = np.zeros((len(matrix), 6 * len(pairs)))
        for number, pair in enumerate(pairs):
            missed, change = _missed(poses, pair)
            weighted = change.T / (1 + missed**2)
            signs = (pair.first, 1), (pair.second, -1)
            ends = [(place[n], sign) for n, sign in signs if n != root]
            scatter = np.linalg.solve(_spread(pair), _leaning(pair))
            for one, sign in ends:
                gradient[one] += sign * weighted @ missed
                leaning[one, 6 * number : 6 * number + 6] = sign * weighted @ scatter
                for other, its_sign in ends:
                    matrix[one, other] += sign * its_sign * weighted @ change
        step: F8 = -np.asarray(np.linalg.solve(matrix, gradient), np.float64)
        poses = poses | {n: small_motion(step[place[n]]) @ poses[n] for n in others}
        if step @ matrix @ step < MIN_STEP_VARIANCE:
            break
    spread: F8 = np.asarray(np.linalg.inv(matrix), np.float64)
    leans = spread @ leaning
    none = {root: np.zeros((6, 6))}
    return (
        poses,
        none | {n: spread[place[n], place[n]] for n in others},
        none | {n: leans[place[n]] @ leans[place[n]].T for n in others},
    )
