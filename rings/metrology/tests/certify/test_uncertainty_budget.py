"""Budgets of sensors that err as the budget's model says."""

import numpy as np
import pytest

from tactograph.rings.metrology.nodes.certify.compare_shapes import Compared
from tactograph.rings.metrology.nodes.certify.uncertainty_budget import uncertainty_budget

GAIN_ERROR, FIDELITY_UM = 0.02, 1.0


def touched(shapes: int, seed: int = 5) -> Compared:
    """Shapes of 500 points up to 0.2 mm, whose gains differ by 2 %, with errors of 1 um."""
    rng = np.random.default_rng(seed)
    shape = np.repeat(np.arange(shapes), 500)
    true = rng.uniform(0, 0.2, len(shape))
    gain = 1 + GAIN_ERROR * rng.normal(size=shapes)
    found = gain[shape] * true + 1e-3 * FIDELITY_UM * rng.normal(size=len(shape))
    unstated = np.full(len(true), np.nan)
    return Compared(true, found, unstated, shape.astype(np.int32), shape.astype(np.int32))


def test_many_shapes_give_back_the_errors_that_were_put_in_and_k_of_two() -> None:
    budget = uncertainty_budget(touched(200), {}, {}, draws=100_000).metrics
    assert budget["uncertainty_relative"] == pytest.approx(GAIN_ERROR, rel=0.1)
    assert budget["uncertainty_constant_um"] == pytest.approx(FIDELITY_UM, rel=0.05)
    assert budget["coverage_factor"] == pytest.approx(2, abs=0.03)
    assert budget["monte_carlo_um"] == pytest.approx(budget["expanded_uncertainty_um"], rel=0.02)
    assert 93 < budget["held_out_percent"] < 97


def test_few_shapes_have_a_larger_factor_and_hold_as_much() -> None:
    draws = (touched(12, seed) for seed in range(20))
    found = [uncertainty_budget(each, {}, {}, draws=1000).metrics for each in draws]
    factors = [each["coverage_factor"] for each in found]
    assert min(factors) > 2.1
    assert 93 < np.mean([each["held_out_percent"] for each in found]) < 97


def test_known_inputs_count_and_are_not_counted_twice() -> None:
    """Noise is a part of what known shapes show; the radius adds to it."""
    plain = uncertainty_budget(touched(50), {}, {}, draws=1000).metrics
    noise = {"measurement_noise_um": 0.6}
    result = uncertainty_budget(
        touched(50), noise, {}, radius_mm=0.25, radius_error_um=5.0, draws=1000
    )
    rows = {row.name: row for row in result.rows}
    assert rows["measurement noise"].uncertainty == 0.6
    assert rows["topography fidelity"].uncertainty == pytest.approx(0.8, rel=0.05)
    same = result.metrics["uncertainty_constant_um"]
    assert same == pytest.approx(plain["uncertainty_constant_um"], rel=1e-6)
    wider = np.hypot(plain["uncertainty_relative"], 0.02)
    assert result.metrics["uncertainty_relative"] == pytest.approx(wider, rel=1e-6)


def test_an_unmeasured_characteristic_is_a_blank_row() -> None:
    budget = uncertainty_budget(Compared(), {}, {})
    assert budget.metrics == {}
    assert {row.uncertainty for row in budget.rows} == {None}
