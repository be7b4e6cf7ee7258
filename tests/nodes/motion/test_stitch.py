"""A surface larger than the film, from touches of its parts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.motion._rigid_fit import IN_DEGREES, F8, small_motion
from tactograph.nodes.motion.stitch import StitchedSurface, stitch
from tests.nodes.motion.moved_objects import PIXEL, SHAPE, plate, pressed, seen

COUNT = 9


def motions() -> list[F8]:
    """Three by three places of the object on the film, each turned and tilted a little."""
    rng, found = np.random.default_rng(4), []
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            shift = np.array([8.0 * column, 6.0 * row, 0.0]) + rng.normal(0, 0.3, 3) * [1, 1, 0.1]
            turn = rng.normal(0, 1, 3) * np.radians([0.3, 0.3, 3])
            found.append(small_motion(np.concatenate([shift, turn])))
    return found


@pytest.fixture(scope="module")
def touches() -> tuple[F4, F4, F4]:
    """Heights, errors, and the heights without noise."""
    rng = np.random.default_rng(6)
    true = np.array([pressed(plate, motion) for motion in motions()])
    heights = np.array([seen(z, rng)[0] for z in true])
    error = np.sqrt(np.square(heights - true).mean())
    return heights, np.full_like(heights, error), true


@pytest.fixture(scope="module")
def whole(touches: tuple[F4, F4, F4]) -> StitchedSurface:
    return stitch(*touches[:2], PIXEL, [str(n) for n in range(COUNT)])


def test_dbg(whole,touches):
    print(whole.height.shape, whole.figures, touches[1].mean())
    np.savez('/tmp/st.npz',h=whole.height,e=whole.error,s=whole.source)
