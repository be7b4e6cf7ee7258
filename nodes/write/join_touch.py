"""Join all that a graph knows of a touch."""

from typing import Annotated, NamedTuple

from tactograph.graph import Port, node
from tactograph.nodes import (
    Confidence,
    Contacts,
    Height,
    HeightError,
    Labels,
    Lens,
    Light,
    Metrics,
    PixelSize,
    Vergence,
)
from tactograph.nodes.stream.frames import LiveState
from tactograph.nodes.stream.touch import MarkerTracks, ObjectPose, Touch


class CapturedFrames(NamedTuple):
    """The frames as captured, their name, and, live, their time and the camera's counters."""

    image: Light
    name: str
    time: Annotated[float, Port(unit="s")] | None = None
    state: LiveState | None = None


class View(NamedTuple):
    """The camera's lens and the place of its pupil."""

    lens: Lens | None = None
    camera: Vergence | None = None


@node(former={"image": "'frames' takes it along with name and time: frames: frames"})
def join_touch(
    height: Height,
    pixel: PixelSize,
    frames: CapturedFrames,
    shadow: Labels | None = None,
    metrics: Metrics | None = None,
    contact: Contacts | None = None,
    error: HeightError | None = None,
    highlight: Labels | None = None,
    confidence: Confidence | None = None,
    view: View | None = None,
    tracks: MarkerTracks | None = None,
    pose: ObjectPose | None = None,
) -> Touch:
    """Return a touch for the nodes that write or show it: `write_result`, `preview` and others.

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    frames
        The node that gives the frames (K x H x W, 0 to 1, as captured): `read_capture`,
        `read_camera` or another.
    shadow : H x W, the LEDs that do not reach each pixel
    metrics : figures, those of `measure_contact` and `judge_touch` among them
    contact : H x W, the number of the contact at each pixel
    error : H x W, the height's standard deviation in mm
    highlight : H x W, the LEDs that the film mirrors
    confidence : H x W, the probability that the shadow labels are right
    view : the calibration, for the lens and the camera's height
    tracks : the film's markers, by `track_markers`
    pose : the object's motion, by `track_pose`
    """
    labels, measured = (shadow, highlight, confidence), (metrics, contact, error)
    moved = (tracks, pose)
    origin = frames.name, frames.time, frames.state
    return Touch(
        height, frames.image, pixel, *origin, *labels, *measured, *(view or View()), *moved
    )
