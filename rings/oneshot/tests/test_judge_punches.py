"""Flat punches of known depth: what walls lose, and what they get back."""

import numpy as np
import pytest

from rings.oneshot.tests.test_map_departure import reflectance
from rings.oneshot.tests.test_map_error import FLAT, PIXEL, SHAPE, punch
from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rating.verdict import Judged
from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.raise_walls import raise_walls
from tactograph.rings.oneshot.nodes.presses.judge_punches import judge_punches

DEPTHS = (0.4, 0.7, 1.0)
RESIDUAL = np.full(3, 0.01, np.float32)


def pressed(depth: float, share: float) -> F4:
    """Light of a punch's film, of whose slope the light shows a share."""
    film = punch(depth, 3.0)
    slope = np.stack([np.gradient(film, PIXEL, axis=1), np.gradient(film, PIXEL, axis=0)])
    shown = np.asarray(share * slope, np.float32)
    return np.asarray(FLAT * mapped_light(shown, film, reflectance(3)), np.float32)


def judged(share: float, depths: tuple[float, ...], stated: tuple[float, ...] | None) -> Judged:
    image = np.stack([pressed(depth, share) for depth in depths])
    names = [f"p{number}" for number in range(len(depths))]
    return judge_punches(image, FLAT, names, reflectance(3), RESIDUAL, PIXEL, depth_mm=stated)


def test_one_punch_is_a_check_and_changes_nothing() -> None:
    quality = judged(0.8, (0.7,), (0.7,)).quality
    assert quality["punches"] == 1
    assert "wall_gain" not in quality
    assert quality["punch_percent"] == pytest.approx(quality["punch_um"] / 7)


def test_walls_are_corrected_by_what_several_punches_show() -> None:
    quality = judged(0.8, DEPTHS, DEPTHS).quality
    each = [judged(0.8, (depth,), (depth,)).quality["punch_um"] for depth in DEPTHS]
    assert quality["wall_gain"] > 0
    assert quality["punch_um"] < 0.5 * np.sqrt(np.mean(np.square(each)))


def test_a_wrong_depth_is_doubtful() -> None:
    assert not judged(1.0, DEPTHS, DEPTHS).doubts
    (doubt,) = judged(1.0, (0.4,), (1.5,)).doubts
    assert "plateau of punch p0" in doubt


def test_depths_must_match_and_punches_must_show() -> None:
    assert judge_punches(FLAT[None], FLAT, [], reflectance(3), RESIDUAL, PIXEL) == ({}, [], "")
    with pytest.raises(InputError, match="2 depths for 3 punches"):
        judged(1.0, DEPTHS, (0.4, 0.7))
    with pytest.raises(InputError, match="0 depths for 1 punches"):
        judged(1.0, (0.4,), None)
    with pytest.raises(InputError, match="punch p0: no contact"):
        judge_punches(FLAT[None], FLAT, ["p0"], reflectance(3), RESIDUAL, PIXEL, depth_mm=(0.5,))


def test_level_and_round_film_is_unchanged() -> None:
    y, x = PIXEL * (np.indices(SHAPE) - (np.array(SHAPE)[:, None, None] - 1) / 2)
    cap = np.stack([-x, -y]).astype(np.float32) / 12
    assert np.abs(raise_walls(cap, 1.0) - cap).max() < 0.01
    edge = np.zeros((2, *SHAPE), np.float32)
    edge[0, :, 60:64] = 2.0
    raised = raise_walls(edge, 1.0)
    assert raised[0, 40, 61] > 2.5
    assert (raised[1] == 0).all()
