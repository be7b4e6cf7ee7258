"""Shadow labels against the truth."""

import numpy as np
import pytest

from tactograph.nodes.evaluate.evaluate_shadow import evaluate_shadow

TRUTH = np.zeros((10, 10), np.uint8)
TRUTH[:4, :5] |= 1
TRUTH[:2, :] |= 8


def test_the_truth_itself_is_perfect_and_nothing_has_no_figures() -> None:
    found = evaluate_shadow(TRUTH, TRUTH)
    assert set(found.values()) == {1.0}
    assert {"shadow_iou", "shadow_iou/led1", "shadow_iou/led4"} <= set(found)
    assert "shadow_iou/led2" not in found
    assert evaluate_shadow(TRUTH) == evaluate_shadow(0 * TRUTH, 0 * TRUTH) == {}


def test_counts_by_hand() -> None:
    found = np.zeros_like(TRUTH)
    found[:4, :10] |= 1  # 40 labelled, 20 of them and all 20 true ones right
    metrics = evaluate_shadow(found, TRUTH)
    assert metrics["shadow_precision/led1"] == pytest.approx(0.5)
    assert metrics["shadow_recall/led1"] == pytest.approx(1.0)
    assert metrics["shadow_iou/led1"] == pytest.approx(0.5)
    assert metrics["shadow_recall/led4"] == 0
    assert "shadow_precision/led4" not in metrics
    assert metrics["shadow_recall"] == pytest.approx(20 / 40)
    assert metrics["shadow_iou"] == pytest.approx(20 / 60)
