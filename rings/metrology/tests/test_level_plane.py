"""The plane that most film shares is level."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.rings.metrology.nodes.filled.level_plane import level_plane

ROWS, COLUMNS = 60, 80
Y, X = np.mgrid[:ROWS, :COLUMNS] / COLUMNS


def tilted(surface: F4, noise: float = 0.002) -> F4:
    rough = np.random.default_rng(1).normal(0, noise, surface.shape)
    return np.asarray(surface + 0.3 * X - 0.2 * Y + rough, np.float32)


def levelled(surface: F4) -> tuple[F4, list[str]]:
    notes: list[str] = []
    with collect_warnings(notes):
        found = level_plane(tilted(surface))
    return found, notes


@pytest.mark.parametrize("share", [0.1, 0.25, 0.4, 0.47, 0.6, 0.9])
def test_a_step_over_any_part_of_the_frame_is_not_tilted(share: float) -> None:
    """Reweighting from the mean plane tilts it where it covers a quarter to a half."""
    step = 0.3 * (share > X).astype(np.float32)
    found, notes = levelled(step)
    ground = 0.3 if share > 0.5 else 0.0
    assert np.abs(found - (step - ground)).max() < 0.02
    warnings = [note for note in notes if "two planes hold" in note]
    assert len(warnings) == (0.25 < share < 0.75)


@pytest.mark.parametrize(
    "surface", [0.05 * np.sin(9 * X) * np.cos(7 * Y), 0 * X], ids=["waves", "flat"]
)
def test_a_surface_without_a_step_is_levelled_as_a_whole(surface: F4) -> None:
    found, notes = levelled(surface)
    assert not notes
    assert abs(np.polyfit(X[0], (found - surface).mean(axis=0), 1)[0]) < 0.02
