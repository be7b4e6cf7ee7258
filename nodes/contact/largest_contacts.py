"""Contacts that have figures of their own: the largest, as many as can be read."""

from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.nodes import Contacts
from tactograph.nodes.contact.find_contact import MAX_CONTACTS

MAX_MEASURED = 16
"""Number of contacts that have figures unless a node's `most` says another."""
Most = Annotated[int, Interval(ge=1, le=MAX_CONTACTS)]
"""Largest number of contacts that have figures."""


def largest_contacts(contact: Contacts, most: int) -> NDArray[np.intp]:
    """Return the numbers, ascending, of the `most` contacts of the largest area."""
    areas = np.bincount(contact[contact > 0])
    largest = np.argsort(-areas, kind="stable")[:most]
    return np.sort(largest[areas[largest] > 0])
