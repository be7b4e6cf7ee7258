"""The ways in which images may be exchanged, mirrored or turned."""

import math
from collections.abc import Callable, Iterator
from itertools import combinations, permutations

from tactograph.nodes import F4

Order = tuple[int, ...]
"""The image that takes each place."""
MAX_ORDERS = 24
"""Orders of more than four LEDs are too many: only two of them are exchanged."""
TURNED_IMAGES: dict[str, Callable[[F4], F4]] = {
    "mirrored left to right": lambda planes: planes[..., ::-1],
    "mirrored top to bottom": lambda planes: planes[..., ::-1, :],
    "turned by half": lambda planes: planes[..., ::-1, ::-1],
}
"""What undoes each way in which a camera may be held or its images turned."""


def swaps(count: int) -> Iterator[Order]:
    """Yield the orders of LEDs in which two are exchanged."""
    for one, other in combinations(range(count), 2):
        order = list(range(count))
        order[one], order[other] = other, one
        yield tuple(order)


def longer_orders(count: int) -> Iterator[Order]:
    """Yield those with more LEDs out of place, those with the fewest first."""
    if math.factorial(count) <= MAX_ORDERS:
        others = {*permutations(range(count))} - {*swaps(count), tuple(range(count))}
        yield from sorted(others, key=lambda order: (len(_out_of_place(order)), order))


def _out_of_place(order: Order) -> list[int]:
    return [place for place, led in enumerate(order) if led != place]


def words_of_order(order: Order) -> str:
    """Return what was done, for the order that undoes it: place k takes image order[k]."""
    match _out_of_place(order):
        case [one, other]:
            return (
                f"the images of LED {one + 1} and LED {other + 1} are swapped: exchanged, they fit "
                "the calibration (check names and wires)"
            )
    right = ", ".join(str(led + 1) for led in order)
    return (
        f"the images are in another order than the calibration's: taken as {right} they fit it "
        "(check names and wires)"
    )
