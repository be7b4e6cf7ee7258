"""Light that no surface explains is told."""

from __future__ import annotations

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes.evaluate.light_misfit import light_misfit


def rated(misfit: np.ndarray) -> tuple[float, list[str]]:
    notes: list[str] = []
    with collect_warnings(notes):
        found = light_misfit(misfit.astype(np.float32))
    return found["light_misfit"], notes


def test_noise_alone_has_a_misfit_near_one_and_no_warning() -> None:
    rng = np.random.default_rng(1)
    mean, notes = rated(rng.chisquare(1, (60, 80)))
    assert mean == pytest.approx(1, abs=0.1)
    assert not notes


def test_light_that_fits_nowhere_is_told() -> None:
    mean, (note,) = rated(np.full((6, 8), 50.0))
    assert mean == 50
    assert "order of the images" in note


def test_a_speck_of_dirt_does_not_outweigh_the_film() -> None:
    misfit = np.ones((60, 80))
    misfit[0, :9] = 1e12
    mean, notes = rated(misfit)
    assert mean < 3
    assert not notes
