"""A gauge R&R study tells apart what parts, operators and trials differ by."""

from pathlib import Path

import numpy as np
import pytest

from rings.metrology.tests.test_measure_step import PIXEL, groove
from tactograph.graph import InputError
from tactograph.nodes import Metrics
from tactograph.rings.metrology.nodes.surface.gauge_study import gauge_study


def study(folder: Path, operators: int, of_trial: float, of_operator: float) -> Metrics:
    """Eight parts of 100 um, give or take 2 um, each measured three times by every operator."""
    rng = np.random.default_rng(4)
    lean = rng.normal(0, of_operator, operators)
    for part, depth in enumerate(100 + np.linspace(-3.3, 3.3, 8)):
        for operator in range(operators):
            for trial in range(3):
                found = depth + lean[operator] + rng.normal(0, of_trial)
                by = f"by{operator}" if operators > 1 else ""
                place = folder / f"part{part}" / by / f"t{trial}"
                place.mkdir(parents=True)
                np.save(place / "height.npy", groove(1e-3 * found, 0.6, 45)[:10])
    return gauge_study(folder=folder, pixel_size_mm=PIXEL)


def test_repeatability_is_the_spread_of_trials(tmp_path: Path) -> None:
    found = study(tmp_path, 1, of_trial=0.5, of_operator=0)
    assert found["gauge_repeatability"] == pytest.approx(0.5, rel=0.4)
    assert found["gauge_rr"] == found["gauge_repeatability"]
    assert found["gauge_parts"] == pytest.approx(2.3, rel=0.2)
    assert "gauge_reproducibility" not in found


@pytest.mark.slow
def test_operators_that_differ_are_reproducibility(tmp_path: Path) -> None:
    found = study(tmp_path, 4, of_trial=0.2, of_operator=1.0)
    assert found["gauge_repeatability"] == pytest.approx(0.2, rel=0.3)
    assert 0.4 < found["gauge_reproducibility"] < 2
    assert found["gauge_rr_percent"] == pytest.approx(
        100 * found["gauge_rr"] / found["gauge_total"], rel=1e-6
    )


def test_an_unbalanced_study_is_refused(tmp_path: Path) -> None:
    study(tmp_path, 1, 0.5, 0)
    (tmp_path / "part3" / "t2" / "height.npy").unlink()
    with pytest.raises(InputError, match="same number of trials"):
        gauge_study(folder=tmp_path, pixel_size_mm=PIXEL)


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no PART/TRIAL"):
        gauge_study(folder=tmp_path)
