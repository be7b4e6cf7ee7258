"""The ways in which images may be exchanged, mirrored or turned."""

from collections.abc import Callable, Iterator
from itertools import combinations

from tactograph.nodes import F4

Order = tuple[int, ...]
"""The image that takes each place."""
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


def ring_orders(count: int) -> Iterator[Order]:
    """Yield other orders of a ring: begun elsewhere, or gone through the other way round."""
    ring = tuple(range(count))
    orders = (way[k:] + way[:k] for way in (ring, ring[::-1]) for k in ring)
    yield from (order for order in orders if order not in {ring, *swaps(count)})


def words_of_order(order: Order) -> str:
    """Return what was done, for the order that undoes it: place k takes image order[k]."""
    moved = [f"LED {place + 1}" for place, led in enumerate(order) if led != place]
    if len(moved) == 2:
        return (
            f"the images of {' and '.join(moved)} are swapped: exchanged, they fit the calibration "
            "(check names and wires)"
        )
    right = ", ".join(str(led + 1) for led in order)
    return (
        f"the images are in another order than the calibration's: taken as {right} they fit it "
        "(check names and wires)"
    )
