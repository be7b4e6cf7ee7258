"""The checks' figures for valid touches that are simulated from a calibration."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.ranks.drawn import OBJECT_FORMS, Doubts
from tactograph.nodes.calibrate.ranks.rank_checks import _without_walls, rank_checks
from tactograph.nodes.trust.check_ranks import CHECK_FIGURES, RANK_COUNT, REST_FIGURES, Ranked
from tests.fixtures import Calibration

EXACT = Doubts(light=0.0, width_mm=1.0)
FLAT, PIXEL = np.ones((4, 60, 80), np.float32), 0.1


@pytest.mark.parametrize("number", range(len(OBJECT_FORMS)))
def test_a_drawn_touch_is_a_surface_above_the_film(number: int) -> None:
    rng = np.random.default_rng(number)
    soft = EXACT.touch(rng, number, FLAT, PIXEL)
    assert soft.height.min() >= 0
    assert np.isfinite(soft.slope).all()
    assert np.abs(soft.slope).max() < 10
    assert np.abs(soft.flat - 1).max() < 0.25


def test_walls_are_those_of_rigid_objects() -> None:
    def steepest(rigid: bool) -> float:
        rng = np.random.default_rng(2)
        touches = (EXACT.touch(rng, n, FLAT, PIXEL, rigid) for n in range(16))
        return float(np.median([np.abs(np.diff(t.height, axis=1)).max() / PIXEL for t in touches]))

    assert steepest(rigid=True) > 2 * steepest(rigid=False)


def test_the_open_errors_of_a_calibration_are_drawn_at_random() -> None:
    doubts = EXACT._replace(level=0.02, light=0.01)
    one, other = (d.touch(np.random.default_rng(1), 0, FLAT, PIXEL) for d in (EXACT, doubts))
    assert np.array_equal(one.height, other.height)
    assert 0.003 < (one.slope - other.slope).std() < 0.06


def test_ranks_are_added_to_a_file_and_nothing_else_changes(
    calibration: Calibration, tmp_path: Path
) -> None:
    """The same seed gives the same ranks; a file from before a figure was added gets its rank."""
    file = tmp_path / "cal.npz"
    shutil.copy(calibration("far28"), file)
    before = read_calibration(file=file)
    np.savez(file, **dict(np.load(file)) | {"ranks": before.ranks[:, 1:]})
    with pytest.raises(InputError, match="not as this version writes it: 'ranks' has shape"):
        read_calibration(file=file)
    rank_checks(file=file, count=10, seed=5)
    after = read_calibration(file=file)
    assert np.array_equal(before.flat, after.flat)
    assert before.quality == after.quality
    assert after.ranks.shape == (len(Ranked), 1 + len(CHECK_FIGURES), RANK_COUNT)
    assert not np.array_equal(before.ranks, after.ranks)
    assert (np.diff(after.ranks, axis=2) >= 0).all()
    rank_checks(file=file, count=10, seed=5)
    assert np.array_equal(after.ranks, read_calibration(file=file).ranks)


def test_the_film_beside_a_rigid_ball_tells_of_film_at_rest() -> None:
    """The grain that JPEG leaves in a press with walls was not known to soft touches."""
    drawn = np.random.default_rng(1).uniform(0, 1, (64, len(CHECK_FIGURES)))
    rigid, soft = np.full((2, 1, len(CHECK_FIGURES)), 5.0) * [[[1]], [[2]]]
    at_rest = [*CHECK_FIGURES].index("light_at_rest")
    for presses in (rigid, np.concatenate([rigid, soft])):
        figures = _without_walls(presses, np.arange(len(presses)) == 0, drawn)
        assert figures[0, at_rest] == 5
        others = 10 if len(presses) > 1 else np.median(drawn, axis=0)
        assert np.array_equal(figures[0], np.where(REST_FIGURES, 5, others))
    assert not _without_walls(rigid[:0], np.zeros(0, bool), drawn).size


def test_only_a_calibration_has_ranks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such calibration file"):
        rank_checks(file=tmp_path / "missing.npz")
    other = tmp_path / "other.npz"
    np.savez(other, flat=np.ones((4, 8, 8)))
    with pytest.raises(InputError, match=r"other\.npz: not a calibration"):
        rank_checks(file=other)
