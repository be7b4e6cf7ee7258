"""A real one-shot sensor's light says little of the radius of a ball."""

from functools import cache

import numpy as np
import pytest

from tactograph.rings.oneshot.nodes.presses.judge_press_radius import judge_press_radius
from tactograph.rings.oneshot.nodes.presses.level_presses import level_presses
from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses
from tests.fixtures import real_data


@cache
def mini() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some presses of the GelSight Mini, its film at rest, and their circles."""
    data = real_data("gelsight_mini_balls")
    film = read_presses(folder=data / "6.310mm", flat=data / "background.png")
    labels = np.genfromtxt(data / "labels.csv", delimiter=",", skip_header=1, usecols=(2, 3, 4))
    numbers = np.array([int(name) for name in film.names])
    inside = (np.abs(labels[:, 0] - 160) < 130) & (np.abs(labels[:, 1] - 120) < 90)
    some = np.flatnonzero(inside[numbers])[::2]
    return level_presses(film.image[some], film.flat), film.flat, labels[numbers[some]]


@pytest.mark.one_case
@pytest.mark.parametrize(("radius", "likelier"), [(3.155, False), (6.31, True)])
def test_a_real_one_shot_sensor_leaves_the_radius_open(radius: float, likelier: bool) -> None:
    image, flat, circle = mini()
    kept = np.ones(len(image), np.uint8)
    verdict = judge_press_radius(
        image, flat, circle.astype(np.float32), kept, 0.0634, radius_mm=radius
    )
    assert not verdict.doubts
    assert "does not confirm the ball's radius" in verdict.unconfirmed
    assert ("times likelier" in verdict.unconfirmed) == likelier
    assert verdict.quality["scale_error_percent"] > 20
