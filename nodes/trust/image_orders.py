"""The ways in which images may be exchanged, mirrored or turned."""

import math
from collections.abc import Callable, Iterator
from itertools import permutations

from tactograph.nodes import F4

MAX_ORDERS = 24
"""Orders of more than four LEDs are too many: only two of them are exchanged."""
IMAGES_SWAPPED = 2
"""Images out of place where two are exchanged."""
TURNED_IMAGES: dict[str, Callable[[F4], F4]] = {
    "mirrored left to right": lambda planes: planes[..., ::-1],
    "mirrored top to bottom": lambda planes: planes[..., ::-1, :],
    "turned by half": lambda planes: planes[..., ::-1, ::-1],
}
"""What undoes each way in which a camera may be held or its images turned."""


def orders(count: int) -> Iterator[tuple[int, ...]]:
    """Yield orders of LEDs, those with the fewest out of place first."""
    if math.factorial(count) <= MAX_ORDERS:
        yield from sorted(permutations(range(count)), key=out_of_place)
        return
    for one in range(count):
        for other in range(one):
            order = list(range(count))
            order[one], order[other] = other, one
            yield tuple(order)


def out_of_place(order: tuple[int, ...]) -> int:
    """Return how many images are not in their place."""
    return sum(led != place for place, led in enumerate(order))


def words_of_order(order: tuple[int, ...]) -> str:
    """Return what was done, for the order that undoes it: place k takes image order[k]."""
    wrong = [place for place, led in enumerate(order) if led != place]
    if len(wrong) == IMAGES_SWAPPED:
        return (
            f"the images of LED {wrong[0] + 1} and LED {wrong[1] + 1} are swapped: exchanged, they "
            "fit the calibration (check names and wires)"
        )
    right = ", ".join(str(led + 1) for led in order)
    return (
        f"the images are in another order than the calibration's: taken as {right} they fit it "
        "(check names and wires)"
    )
