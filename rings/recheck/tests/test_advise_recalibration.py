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


@pytest.mark.parametrize(
    ("refitted", "doubt"),
    [
        ({"thicker_mm": 3.25}, "new gel is +3.25 mm thicker"),
        ({"gain_percent/light1": 182, "gain_percent/light2": 193}, "1.9 times as much on slope"),
        ({"thicker_mm": 0.3, "gain_percent/light1": 80.0}, ""),
    ],
)
def test_what_a_wrong_radius_may_explain_is_a_doubt_of_the_file(
    refitted: dict[str, float], doubt: str
) -> None:
    """Heights were 10 to 50 % off, and nothing spoke against the file."""
    found = advise_recalibration(SAME, 0.1, {"check_deg/held_out": 0.2} | refitted, {}, ["old"])
    assert found.doubts[0] == "old"
    assert [doubt in each and "not its diameter" in each for each in found.doubts[1:]] == (
        [True] if doubt else []
    )
    assert found.quality["full_calibration_due"] == bool(doubt)
