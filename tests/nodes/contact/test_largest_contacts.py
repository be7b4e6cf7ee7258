"""Contacts of a grid of many balls: those that have figures."""

import numpy as np

from tactograph.nodes.contact.largest_contacts import LargestContacts

MAX_MEASURED = LargestContacts().most
SMALL = (7, 30, 31, 59)
COUNT = MAX_MEASURED + len(SMALL)
LARGE = [number for number in range(41, 41 + COUNT) if number not in SMALL]
CONTACT = np.zeros((100, 20 * COUNT), np.uint8)
for column, named in enumerate([*SMALL, *LARGE[:MAX_MEASURED]]):
    side = 8 if named in SMALL else 12
    CONTACT[40 : 40 + side, 20 * column : 20 * column + side] = named
HEIGHT = np.where(CONTACT > 0, np.float32(0.1), np.float32(0))


def test_the_largest_contacts_by_number() -> None:
    assert LargestContacts().numbers(CONTACT).tolist() == LARGE[:MAX_MEASURED]
    assert LargestContacts(254).numbers(CONTACT).tolist() == sorted([*SMALL, *LARGE[:MAX_MEASURED]])
    assert LargestContacts(254).numbers(np.zeros_like(CONTACT)).size == 0
