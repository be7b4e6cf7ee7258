"""Select the contacts that get figures: the largest, so that a person can read them."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.nodes import Contacts
from tactograph.nodes.contact.find_contact import MAX_CONTACTS


class LargestContacts(NamedTuple):
    """The parameter of a node that measures contacts one by one.

    Parameters
    ----------
    most : largest number of contacts with figures; of more, the largest are taken
    """

    most: Annotated[int, Interval(ge=1, le=MAX_CONTACTS)] = 16

    def numbers(self, contact: Contacts) -> NDArray[np.intp]:
        """Return the numbers of these contacts in ascending order."""
        areas = np.bincount(contact[contact > 0])
        largest = np.argsort(-areas, kind="stable")[: self.most]
        return np.sort(largest[areas[largest] > 0])
