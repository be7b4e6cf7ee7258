"""A law of checks for tests: valid touches whose figures are normal, each of its own size."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.trust.check_ranks import CHECK_FIGURES, figures_of, ranked
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.touch_evidence import TouchEvidence

SIZES = dict.fromkeys(CHECK_FIGURES, 0.0) | {
    "curl": 0.3, "light_at_rest": 0.5, "light": 0.8,
    "darker": 0.001, "brighter": 0.001, "level": 0.02,
    "shape": 0.01, "moved": 0.002, "touched_share": 0.2, "depth": 0.1, "lines": 0.5,
}  # fmt: skip


def ranks() -> F4:
    """The ranks of 400 valid touches, for every kind of touch."""
    drawn = np.abs(np.random.default_rng(1).normal(size=(400, len(SIZES)))) * [*SIZES.values()]
    return np.asarray(np.stack([ranked(drawn)] * 3), np.float32)


def by_name(evidence: TouchEvidence, lines: LineChanges | None = None) -> dict[str, float]:
    """The figures of a touch."""
    return dict(zip(CHECK_FIGURES, figures_of(evidence, lines).tolist(), strict=True))
