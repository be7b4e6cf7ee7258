"""A recalibration whose check press is far off says so at once."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.rings.recheck.nodes.advise_recalibration import advise_recalibration
from tactograph.rings.recheck.nodes.film_change import FilmChange

LEVEL = np.zeros((6, 8), np.float32)
SAME = FilmChange(np.ones(4, np.float32), 0.0, np.zeros(2, np.float32), LEVEL, LEVEL)


@pytest.mark.parametrize(
    ("error", "full", "warned"),
    [(0.4, 0.3, False), (2.9, 0.3, False), (34.7, 0.3, True), (3.5, 3.0, False)],
)
def test_a_press_that_cannot_be_right_is_a_warning(error: float, full: float, warned: bool) -> None:
    with collect_warnings([]) as notes:
        advise_recalibration(SAME, 0.1, {"check_deg/held_out": error}, {"film_heldout_deg": full})
    assert bool(notes) == warned
    assert all("order of the press's images" in note for note in notes)
