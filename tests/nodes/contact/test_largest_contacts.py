"""Contacts of a grid of many balls: those that have figures."""

import numpy as np

from tactograph.nodes.contact.largest_contacts import MAX_MEASURED, largest_contacts

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
