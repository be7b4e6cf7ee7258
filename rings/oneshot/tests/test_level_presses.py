"""The light of presses drifts, as that of touches does."""

import numpy as np

from tactograph.rings.oneshot.nodes.presses.level_presses import level_presses
from tests.nodes.light.test_film_drift import FADED, SIZE, film, shaped, touched


def test_presses_are_levelled_by_the_film_around_them() -> None:
    flat = np.full((4, *SIZE), 0.4, np.float32)
    tilt = np.zeros((4, 6), np.float32)
    tilt[:, 0], tilt[:, 1] = 1, 0.01
    presses = np.stack([0.4 * touched(film(g)) for g in (1.0, FADED[:, None, None], shaped(tilt))])
    found = level_presses(presses.astype(np.float32), flat, degree=2)
    for press in found:
        assert np.abs(press[:, :, :12].mean(axis=(1, 2)) / 0.4 - 1).max() < 2e-3
