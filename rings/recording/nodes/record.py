"""Record the camera's raw frames, so that they can be replayed through any graph."""

import json
from pathlib import Path

from tactograph.rings.frames.live_frames import ALL_LIT, RawFrame
from tactograph.rings.recording.files.mcap_log import Limits, McapLog
from tactograph.rings.recording.files.ros_messages import Message, image_message, text_message
from tactograph.sdk import Light, LiveState, Provenance, SensorIdentity, Session, node

RECORDING_FORMAT = "1"


@node
def record(
    new: list[RawFrame],
    image: Light,
    name: str,
    state: LiveState | None = None,
    *,
    folder: Path,
    limits: Limits,
    provenance: Provenance,
    session: Session,
) -> None:
    """Record the frames of a touch as MCAP files, which `replay`, Foxglove and ROS 2 read.

    The files are ``folder/000001_<start>.mcap`` and so on.  A frame is a sensor_msgs/Image on
    the topic ``/led<k>/image_raw`` (``/off/image_raw`` with all LEDs off, ``/colour/image_raw``
    for a one-shot sensor), stamped with the end of its exposure.  The frames of a touch are
    followed by its name and the camera's state as JSON on ``/touch``.  Once this function
    returns, killing the program loses none of the touch, unless the disk has not taken it within
    a quarter of a second.  A power cut loses what has not yet been synced, see `sync_ms`.

    The files' metadata keep the sensor's name and serial number, as calibration and camera tell
    them, and the calibration's hash and date.

    A disk that is slow, full or gone does not stop the stream: touches are left out, with one
    warning and a count, and recording resumes when the disk does.

    Parameters
    ----------
    new : the frames since the previous touch, each H x W or H x W x 3, 8 or 16 bit
    image : K x H x W; gives the number of LEDs
    name : the touch's name
    state : the camera's counters, written with each touch
    folder
        Created if needed.  An existing recording is continued in new files.

    Raises
    ------
    InputError
        If the folder cannot be written when the recording begins, or the ``mcap`` libraries
        are not installed.
    """
    log = session.keep(lambda: _opened(folder, limits, len(image), state, provenance))
    messages = [_frame(frame, log.stamps.of(frame.time)) for frame in new]
    text = json.dumps(
        {
            "name": name,
            "frames": [frame.number for frame in new],
            "state": vars(state) if state is not None else None,
        },
        default=str,
    )
    now = messages[-1].time if messages else log.stamps.of(None)
    log.put([*messages, text_message("/touch", now, text)])


def _opened(
    folder: Path, limits: Limits, leds: int, state: LiveState | None, provenance: Provenance
) -> McapLog:
    about = {
        "format": RECORDING_FORMAT,
        "leds": str(leds),
        "graph": json.dumps(provenance.graph),
        "versions": json.dumps(provenance.versions),
        **_sensor(state, provenance),
    }
    return McapLog(folder, about, limits)


def _frame(frame: RawFrame, stamp: int) -> Message:
    source = {0: "off", ALL_LIT: "colour"}.get(frame.led, f"led{frame.led}")
    return image_message(f"/{source}/image_raw", stamp, frame.data, source, frame.number)


def _sensor(state: LiveState | None, provenance: Provenance) -> dict[str, str]:
    """Return the sensor, by the camera's serial number if it has one, and its calibration."""
    identity = SensorIdentity.behind(provenance)
    serial = str((state.settings if state else {}).get("serial") or identity.serial)
    inputs = json.dumps(provenance.inputs) if provenance.inputs else ""
    header = {"sensor": identity.name, "serial": serial, "inputs": inputs}
    return {name: text for name, text in header.items() if text}
