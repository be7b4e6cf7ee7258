"""Find the contacts with the film."""

from collections.abc import Sequence
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import Close, InputError, node, warn
from tactograph.nodes import DEVIATIONS_PER_MAD, Contacts, Height, HeightError

MIN_SAMPLES = 10_000
"""Smallest number of pixels for the noise, spread evenly, since errors of neighbours correlate."""
MAX_CONTACTS = 254
"""Largest number of a contact: numbers have 8 bits."""
NO_CONTACT = np.uint8(MAX_CONTACTS + 1)
"""Mark of raised film that belongs to no contact yet; smaller values are numbers of contacts."""


@node(tolerance=Close(share=1e-3, why="thresholds on a rounded height"))
def find_contact(
    height: Height,
    error: HeightError | None = None,
    *,
    enter: Annotated[float, Gt(0)] = 10.0,
    leave: Annotated[float, Gt(0)] = 4.0,
    least_error_mm: Annotated[float, Gt(0)] = 0.001,
    least_px: Annotated[int, Interval(ge=1)] = 20,
    most: Annotated[int, Interval(ge=1, le=MAX_CONTACTS)] = MAX_CONTACTS,
) -> Contacts:
    """Number the contacts: connected film that exceeds its error, by hysteresis thresholding.

    A contact is a region of film higher than `leave` errors, connected over edges or corners,
    in which at least `least_px` pixels are higher than `enter` errors.  With two thresholds
    noise neither starts a contact nor frays its edge (J. Canny, "A computational approach to edge
    detection", 1986).

    Without a stated error the film at rest gives it: heights below rest are pure noise, and noise
    is as often below as above.  Their median magnitude, over that of a normal variable, is the
    error of all pixels, however much of the frame is touched.  A film that bulges downwards around
    a contact makes that error larger, and the contact smaller.

    Parameters
    ----------
    height : H x W in mm above the film at rest
    error : H x W, the height's standard deviation in mm; None: it is estimated
    enter, leave
        In multiples of the error; `leave` must not exceed `enter`.  A height is a sum of noisy
        slopes, so errors of neighbours are similar, and the largest of a frame is 4 to 8 times
        their standard deviation.
    least_error_mm : lower bound on the error
    least_px : smallest number of pixels of a contact that are above `enter`, or enclosed by such
    most : largest number of contacts; if there are more, the largest are numbered, with a warning

    Returns
    -------
    H x W, 1 on the contact of the largest area, 2 on the next, 0 on free film.

    Raises
    ------
    InputError
        If `leave` exceeds `enter`.
    """
    if leave > enter:
        raise InputError(f"`leave`={leave:g} is above `enter`={enter:g}; make it smaller")
    if error is None:
        level: Height | np.float32 = np.float32(max(_rest_noise(height), least_error_mm))
    else:
        level = np.maximum(error, np.float32(least_error_mm))
    high = (height > np.float32(enter) * level).view(np.uint8)
    lines, nested = cv2.findContours(high, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not lines:
        return np.zeros(height.shape, np.uint8)
    # A contour without a parent surrounds a core; the others surround its holes.
    parents = nested[0, :, 3].tolist()
    outlines = [line for line, parent in zip(lines, parents, strict=True) if parent < 0]
    raised = (height > np.float32(leave) * level).view(np.uint8) * NO_CONTACT
    areas, cores = _fill(raised, outlines)
    contacts = [number for number in areas if cores[number] >= least_px]
    if len(contacts) > most:
        warn(f"{len(contacts)} contacts; the {most} largest are numbered (`most` sets the number)")
    elif len(contacts) == MAX_CONTACTS:
        warn(f"{MAX_CONTACTS} contacts or more; the largest are numbered")
    largest = sorted(contacts, key=lambda number: -areas[number])[:most]
    numbers = np.zeros(256, np.uint8)
    numbers[largest] = np.arange(1, len(largest) + 1)
    return np.asarray(cv2.LUT(raised, numbers))


def _fill(
    raised: NDArray[np.uint8], outlines: Sequence[NDArray[Any]]
) -> tuple[dict[int, float], dict[int, float]]:
    """Fill each region around outlined cores with a number; return the areas of both.

    Pick's theorem gives the number of pixels of an outline and its interior.
    """
    sizes = [cv2.contourArea(line) + len(line) / 2 + 1 for line in outlines]
    areas: dict[int, float] = {}
    cores: dict[int, float] = {}
    for size, line in sorted(zip(sizes, outlines, strict=True), key=lambda each: -each[0]):
        x, y = map(int, line[0, 0])
        number = int(raised[y, x])
        if number == NO_CONTACT:
            number = len(areas) + 1
            if number == NO_CONTACT:
                break
            areas[number] = float(cv2.floodFill(raised, None, (x, y), number, flags=8)[0])
            cores[number] = 0.0
        cores[number] += size
    return areas, cores


def _rest_noise(height: Height) -> float:
    """The standard deviation of the film at rest in mm; zero if no height is below rest."""
    step = max(1, int((height.size / MIN_SAMPLES) ** 0.5))
    heights = height[::step, ::step].ravel()
    below = np.count_nonzero(heights < 0)
    if not below:
        return 0.0
    # The median of the heights below zero, by a partition of all: faster than selecting first,
    # and four times as fast as around the two in the middle of an even number.
    middle = below // 2
    return DEVIATIONS_PER_MAD * -float(np.partition(heights, middle)[middle])
