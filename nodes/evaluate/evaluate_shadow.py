"""Compare shadow labels with the truth, LED by LED."""

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import Labels, Metrics


@node
def evaluate_shadow(shadow: Labels, truth: Labels | None = None) -> Metrics:
    """Return how well the shadows of each LED were found, or nothing without truth.

    A pixel counts once for every LED.  A figure with denominator zero is left out: precision if
    nothing was labelled, recall if there is no shadow.

    Parameters
    ----------
    shadow, truth : H x W; bit k-1 is set where LED k does not reach the pixel

    Returns
    -------
    dict
        ``shadow_precision``, the share of the labelled pixels that are in shadow;
        ``shadow_recall``, the share of the shadow that is labelled; ``shadow_iou``,
        intersection over union; over all LEDs, and as ``shadow_iou/led1`` ... for each one.
    """
    if truth is None:
        return {}
    leds = int(np.bitwise_or.reduce(shadow | truth, axis=None)).bit_length()
    masks, bits = (shadow & truth, shadow, truth), 1 << np.arange(max(leds, 1), dtype=np.uint8)
    counts = np.array([[np.count_nonzero(mask & bit) for mask in masks] for bit in bits])
    metrics = _rates(counts.sum(axis=0), "")
    for k, count in enumerate(counts, start=1):
        metrics |= _rates(count, f"/led{k}")
    return metrics


def _rates(counts: NDArray[np.int64], suffix: str) -> Metrics:
    labelled_and_true, labelled, true = counts
    rates = {
        "precision": (labelled_and_true, labelled),
        "recall": (labelled_and_true, true),
        "iou": (labelled_and_true, labelled + true - labelled_and_true),
    }
    return {f"shadow_{name}{suffix}": float(n / sum_) for name, (n, sum_) in rates.items() if sum_}
