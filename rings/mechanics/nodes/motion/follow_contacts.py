"""Contacts that keep their number from frame to frame."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray
from scipy.ndimage import center_of_mass
from scipy.optimize import linear_sum_assignment

from tactograph.sdk import F4, F8, Contacts, LargestContacts, Lens, PixelSize, Port, View, node

COLUMN_AGE, COLUMN_UNSEEN, COLUMN_X, COLUMN_Y, COLUMN_VX, COLUMN_VY = range(6)
"""Columns of the tracks: frames since it began, frames since it was last seen, centre in px,
px per frame."""
FORBIDDEN_COST = 1e3
"""Cost of a pair that cannot be one contact."""
VELOCITY_SHARE = 0.5
"""Weight of the newest displacement in the velocity; the rest is the velocity before."""
MIN_RADIUS_PX = 3.0
Tracks = Annotated[F4, Port("254 6", "frames, px, px/frame")]
"""A row per number, see `COLUMN_AGE`; age 0: the number is free."""


class FollowedContacts(NamedTuple):
    """Contacts under lasting numbers, the track of each number, and figures."""

    contact: Contacts
    tracks: Tracks
    figures: dict[str, float]


@node
def follow_contacts(
    contact: Contacts,
    pixel: PixelSize,
    before: Contacts | None = None,
    tracks: Tracks | None = None,
    lens: Lens | None = None,
    *,
    reach: Annotated[float, Gt(0)] = 1.5,
    patience: Annotated[int, Interval(ge=0, le=1000)] = 3,
    largest: LargestContacts,
) -> FollowedContacts:
    """Give each contact the number that it had in the frames before.

    Pairs of a contact now and one before are chosen together for the least total cost (Hungarian
    algorithm).  Contacts that overlap cost least, by how much they overlap; others cost their
    distance from where the velocity leads, up to `reach` radii.  So of a contact that splits, the
    part that overlaps most keeps the number, and the others begin; where contacts merge, the one
    that overlaps most goes on, and the others end.  One that is gone for no more than `patience`
    frames keeps its number.  A new contact takes the lowest free number.

    Parameters
    ----------
    contact : H x W, as `find_contact` gives it
    pixel : mm per px
    before, tracks
        This node's own ``contact`` and ``tracks`` of the frame before (``previous.NODE.contact``);
        without them all contacts begin.
    lens : of the calibration, for speeds on the film; None: an even grid
    reach
        How far a contact may move in a frame without overlapping itself, in multiples of its
        radius.
    patience : frames
    most : largest number of contacts that have figures, the largest; all are followed

    Returns
    -------
    Contacts H x W, tracks 254 x 6, and figures: ``contact_age/c1`` in frames;
    ``contact_speed_x_mm/c1``, ``contact_speed_y_mm/c1`` in mm per frame.
    """
    shape = [int(size) for size in follow_contacts.outputs["tracks"].dims]
    rows = np.zeros(shape, np.float32) if tracks is None else tracks.copy()
    numbers = np.unique(contact[contact > 0])
    alive = np.flatnonzero(rows[:, COLUMN_AGE] > 0)
    places = np.array(center_of_mass(contact > 0, contact, numbers)).reshape(-1, 2)[:, ::-1]
    earlier = np.zeros_like(contact) if before is None else before
    both = np.bincount(contact.ravel() * np.intp(256) + earlier.ravel(), minlength=256**2)
    cost = _costs(both.reshape(256, 256), numbers, places, rows[alive], alive + 1, reach)
    pairs = zip(*linear_sum_assignment(cost), strict=True)
    number_of = {
        int(now): int(alive[then]) for now, then in pairs if cost[now, then] < FORBIDDEN_COST
    }
    rows[alive, COLUMN_UNSEEN] += 1
    free = iter(np.flatnonzero(rows[:, COLUMN_AGE] == 0).tolist())
    lasting = np.zeros(256, np.uint8)
    for now, number in enumerate(numbers):
        row = number_of[now] if now in number_of else next(free, None)
        if row is not None:
            _go_on(rows[row], places[now])
            lasting[number] = row + 1
    rows[rows[:, COLUMN_UNSEEN] > patience] = 0
    followed = lasting[contact]
    figures: dict[str, float] = {}
    for lasts in largest.numbers(followed):
        age, _, x, y, *speed = rows[lasts - 1].tolist()
        stretch = View(lens).ideal_steps(contact.shape, x, y)
        speed_x, speed_y = pixel * stretch @ speed
        figures[f"contact_age/c{lasts}"] = age
        figures[f"contact_speed_x_mm/c{lasts}"] = float(speed_x)
        figures[f"contact_speed_y_mm/c{lasts}"] = float(speed_y)
    return FollowedContacts(followed, rows, figures)


def _costs(
    both: NDArray[np.int_],
    numbers: NDArray[np.uint8],
    places: F8,
    tracks: F4,
    earlier: NDArray[np.intp],
    reach: float,
) -> F8:
    """Costs of pairs of a contact now and an earlier one: below 0 where they overlap.

    `both` holds the pixels by number now and number before.
    """
    frames = tracks[:, COLUMN_UNSEEN] + 1
    moved = frames[:, None] * tracks[:, [COLUMN_VX, COLUMN_VY]]
    expected = tracks[:, [COLUMN_X, COLUMN_Y]] + moved
    area = both[numbers].sum(axis=1)[:, None]
    radius = np.maximum(np.sqrt(area / np.pi), MIN_RADIUS_PX)
    distance = np.hypot(*np.moveaxis(expected - places[:, None], 2, 0))
    distance /= reach * radius * np.sqrt(frames)
    shared = both[np.ix_(numbers, earlier)]
    either = np.maximum(area + both[:, earlier].sum(axis=0) - shared, 1)
    far = np.where(distance < 1, distance, FORBIDDEN_COST)
    return np.where(shared > 0, -shared / either, far)


def _go_on(track: F4, place: F8) -> None:
    """Note where a contact is now."""
    if track[COLUMN_AGE] > 0:
        moved = (place - track[[COLUMN_X, COLUMN_Y]]) / max(float(track[COLUMN_UNSEEN]), 1.0)
        track[[COLUMN_VX, COLUMN_VY]] += VELOCITY_SHARE * (moved - track[[COLUMN_VX, COLUMN_VY]])
    track[[COLUMN_X, COLUMN_Y]] = place
    track[COLUMN_AGE] += max(float(track[COLUMN_UNSEEN]), 1.0)
    track[COLUMN_UNSEEN] = 0
