"""Markers that move over the object that presses on them."""

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tactograph.rings.mechanics.nodes.marker.marker_places import marker_places
from tactograph.rings.mechanics.nodes.motion._surface import IN_DEGREES, small_motion
from tactograph.sdk import F4, F8, Contacts, Height, LargestContacts, PixelSize, Port, View, node

COLUMN_X, COLUMN_Y, COLUMN_VARIANCE = range(3)
COLUMN_STATE, COLUMN_STILL, COLUMN_WAY, COLUMN_CONTACT = range(3, 7)
"""Columns of the slides: where on the object a marker is held, mm; the variance of the pose
there, mm^2; `STATE_FREE` and so on; frames since it last slipped; the way that it has slipped,
mm; the state of its contact."""
STATE_FREE, STATE_HELD, STATE_SLIPPING = range(3)
_, SLIP_PARTLY, SLIP_WHOLLY = range(3)
"""States of a contact; 0 is stuck."""
PARTLY_SHARE, WHOLLY_SHARE = (0.1, 0.05), (0.9, 0.8)
"""Shares of slipping markers above which a contact begins to slip, and goes on to."""
MIN_MARKERS = 3
"""Least number of markers that tell of a contact."""
MAX_POSE_MM = 0.2
"""Standard deviation of the object's place above which its motion is open."""
CERTAIN_SHARE = 1 / 3
"""Largest deviation of the object's way, as a share of the least slip."""
Slides = Annotated[F4, Port("M 7", "mm, frames")]
"""A row per marker, see `COLUMN_X`."""


class Slip(NamedTuple):
    """The state of each marker for the next frame, and figures by contact."""

    slides: Slides
    figures: dict[str, float]


@node
def find_slip(
    height: Height,
    contact: Contacts,
    tracks: MarkerTracks,
    moved: ObjectPose,
    pixel: PixelSize,
    view: View | None = None,
    before: Slides | None = None,
    *,
    slip_mm: Annotated[float, Gt(0)] = 0.06,
    hold_frames: Annotated[int, Interval(ge=1, le=1000)] = 3,
    margin_px: Annotated[int, Interval(ge=0, le=100)] = 6,
    largest: LargestContacts,
) -> Slip:
    """Tell which contacts slip, from the way of the film's markers over the moving object.

    The object's pose tells where on the object a marker is.  A marker that goes `slip_mm` from
    where it is held slips, and goes on slipping while it moves by half of that within
    `hold_frames`; then it is held where it is.  So slip is reported once a marker has gone
    `slip_mm`, and its end after `hold_frames`; a slower slip comes in steps.

    A contact slips partly from a tenth of its markers on, and two at least; wholly from nine
    tenths; back below 0.05 and 0.8.  Contacts of fewer than 3 markers, those whose motion the
    shape leaves open (a ball that rolls, or slips?), and the first frame of a touch have no
    figures.

    Parameters
    ----------
    height : H x W in mm, as seen by the camera
    contact : H x W, with numbers that last, as `follow_contacts` gives it
    tracks : the film's markers, by `track_markers`
    moved : the object's motion, by `track_pose`
    pixel : mm per px
    view : the calibration, for the lens and the camera's height
    before : this node's own ``slides`` of the frame before (``previous.NODE.slides``)
    slip_mm
        Least slip.  Above the noise of markers and pose, 3 to 10 um.
    hold_frames : frames
    margin_px : width of the contact's rim whose markers do not count: film hangs there

    Returns
    -------
    Figures ``contact_slip/c1`` (0: stuck, 1: partly, 2: wholly slipping), ``contact_slip_share/c1``
    of its markers, ``contact_slip_mm/c1``, the median way, and ``contact_slip_markers/c1``, how
    many tell it.
    """
    markers = marker_places(height, tracks, pixel, view)
    rim = np.ones((2 * margin_px + 1,) * 2, np.uint8)
    inner = cv2.erode(contact, rim, borderValue=0)
    number = np.where(markers.inside, inner[markers.pixel], 0)
    slides = np.zeros((len(number), 7), np.float32) if before is None else before.copy()
    # The first pose of a touch is exact, and tells of no motion yet.
    begins = not moved.covariance.any()
    slides[(number == 0) | begins] = 0
    on_object, variance = _on_object(markers.place, moved)
    judged = (number > 0) & (tracks.visible > 0) & (variance < MAX_POSE_MM**2)
    _slide(slides, judged, on_object, variance, slip_mm, hold_frames)
    figures: dict[str, float] = {}
    for contact_number in largest.numbers(contact):
        mine = np.flatnonzero(judged & (number == contact_number))
        if begins or len(mine) < MIN_MARKERS:
            continue
        share = float(np.mean(slides[mine, COLUMN_STATE] == STATE_SLIPPING))
        last = int(slides[mine, COLUMN_CONTACT].max())
        partly, wholly = PARTLY_SHARE[last >= SLIP_PARTLY], WHOLLY_SHARE[last >= SLIP_WHOLLY]
        # One marker may have been taken for another.
        state = float((share > max(partly, 1 / len(mine))) + (share > wholly))
        slides[mine, COLUMN_CONTACT] = state
        figures[f"contact_slip/c{contact_number}"] = state
        figures[f"contact_slip_share/c{contact_number}"] = share
        figures[f"contact_slip_mm/c{contact_number}"] = float(np.median(slides[mine, COLUMN_WAY]))
        figures[f"contact_slip_markers/c{contact_number}"] = float(len(mine))
    return Slip(slides, figures)


def _slide(
    slides: F4,
    judged: NDArray[np.bool_],
    on_object: F8,
    variance: F8,
    slip_mm: float,
    hold_frames: int,
) -> None:
    """Note which of the judged markers are held and which slip."""
    held_at = slides[:, [COLUMN_X, COLUMN_Y]]
    way, state = np.hypot(*(on_object - held_at).T), slides[:, COLUMN_STATE]
    # What the pose has lost since, as from one key frame to the next, is no slip.
    lost = np.abs(variance - slides[:, COLUMN_VARIANCE]) > (CERTAIN_SHARE * slip_mm) ** 2
    least = np.where(state == STATE_SLIPPING, slip_mm / 2, slip_mm)
    slips = judged & (state != STATE_FREE) & ~lost & (way > least)
    slides[slips, COLUMN_WAY] += way[slips]
    slides[judged, COLUMN_STILL] += 1
    slides[slips, COLUMN_STILL] = 0
    rests = judged & (state == STATE_SLIPPING) & (slides[:, COLUMN_STILL] >= hold_frames)
    renewed = slips | rests | (judged & (lost | (state == STATE_FREE)))
    slides[judged & (state == STATE_FREE) | rests, COLUMN_STATE] = STATE_HELD
    slides[slips, COLUMN_STATE] = STATE_SLIPPING
    anchor = np.column_stack([on_object[:, :2], variance])[renewed]
    slides[renewed, : COLUMN_VARIANCE + 1] = anchor


def _on_object(place: F8, moved: ObjectPose) -> tuple[F8, F8]:
    """Places on the object, x and y in mm, and the larger variance of the two by the pose."""
    motion = small_motion(moved.pose / IN_DEGREES)
    arm = place - motion[:3, 3]
    x, y, z = arm.T
    one, no = np.ones_like(x), np.zeros_like(x)
    shifts = np.array([[one, no, no, no, z, -y], [no, one, no, -z, no, x]]) / IN_DEGREES[:, None]
    variance = np.einsum("aim,ij,ajm->am", shifts, moved.covariance.astype(np.float64), shifts)
    return (arm @ motion[:3, :3])[:, :2], variance.max(axis=0)
