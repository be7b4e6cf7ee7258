"""Contacts of a grid of many balls: those that have figures."""

import numpy as np
import pytest

from tactograph.nodes import Metrics
from tactograph.nodes.contact.largest_contacts import MAX_MEASURED, largest_contacts
from tactograph.rings.mechanics.nodes.force.press_to_pressure import press_to_pressure
from tactograph.rings.mechanics.nodes.motion.follow_contacts import follow_contacts
from tactograph.rings.metrology.nodes.surface.surface_texture import surface_texture

SMALL = (7, 30, 31, 59)
COUNT = MAX_MEASURED + len(SMALL)
LARGE = [number for number in range(41, 41 + COUNT) if number not in SMALL]
CONTACT = np.zeros((100, 20 * COUNT), np.uint8)
for column, named in enumerate([*SMALL, *LARGE[:MAX_MEASURED]]):
    side = 8 if named in SMALL else 12
    CONTACT[40 : 40 + side, 20 * column : 20 * column + side] = named
HEIGHT = np.where(CONTACT > 0, np.float32(0.1), np.float32(0))


def test_the_largest_contacts_are_told_by_their_numbers() -> None:
    assert largest_contacts(CONTACT, MAX_MEASURED).tolist() == LARGE[:MAX_MEASURED]
    assert largest_contacts(CONTACT, 254).tolist() == sorted([*SMALL, *LARGE[:MAX_MEASURED]])
    assert largest_contacts(np.zeros_like(CONTACT), 254).size == 0


@pytest.mark.parametrize("node", ["follow", "force", "texture"])
def test_only_the_largest_contacts_have_figures(node: str) -> None:
    """All are followed and press, but a frame has not hundreds of figures."""
    figures: Metrics
    if node == "follow":
        followed = follow_contacts(CONTACT, 0.1)
        assert np.array_equal(followed.contact > 0, CONTACT > 0)
        figures = followed.figures
    elif node == "force":
        gel = {"modulus_kpa": 100.0, "thickness_mm": 3.0}
        pressed = press_to_pressure(HEIGHT, CONTACT, 0.1, np.full_like(HEIGHT, 1e-3), **gel)
        assert np.all(pressed.pressure[SMALL[0] == CONTACT] != 0)
        figures = pressed.figures
    else:
        pytest.importorskip("surfalize")
        figures = surface_texture(HEIGHT, 0.1, CONTACT)
    assert len({name.rpartition("/")[2] for name in figures}) == MAX_MEASURED
