"""Shadow labels against the truth."""

import numpy as np
import pytest

from tactograph.nodes.evaluate.evaluate_shadow import evaluate_shadow

TRUTH = np.zeros((10, 10), np.uint8)
TRUTH[:4, :5] |= 1
TRUTH[:2, :] |= 8


def test_the_truth_itself_is_perfect_and_empty_labels_have_no_figures() -> None:
    figures = evaluate_shadow(TRUTH, TRUTH)
    assert set(figures.values()) == {1.0}
    assert {"shadow_iou", "shadow_iou/led1", "shadow_iou/led4"} <= set(figures)
    assert "shadow_iou/led2" not in figures
    assert evaluate_shadow(TRUTH) == evaluate_shadow(0 * TRUTH, 0 * TRUTH) == {}


def test_figures_agree_with_counts_by_hand() -> None:
    labels = np.zeros_like(TRUTH)
    labels[:4, :10] |= 1  # 40 labelled, 20 of them and all 20 true ones right
    metrics = evaluate_shadow(labels, TRUTH)
    assert metrics["shadow_precision/led1"] == pytest.approx(0.5)
    assert metrics["shadow_recall/led1"] == pytest.approx(1.0)
    assert metrics["shadow_iou/led1"] == pytest.approx(0.5)
    assert metrics["shadow_recall/led4"] == 0
    assert "shadow_precision/led4" not in metrics
    assert metrics["shadow_recall"] == pytest.approx(20 / 40)
    assert metrics["shadow_iou"] == pytest.approx(20 / 60)
