"""Replay a recording: assemble the frames of `record` into touches again.

Long because a recording may be cut off, damaged or of another sensor, and each has its message.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from itertools import chain, islice, pairwise
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from tactograph.rings.frames.assemble import Assembler, Refresh
from tactograph.rings.frames.colour_planes import planes_of
from tactograph.rings.frames.live_frames import ALL_LIT, LiveFrames, RawFrame
from tactograph.rings.frames.rest_film import full_scale, make_film, top_of
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapMessage, McapReader
from tactograph.rings.recording.files.ros_messages import read_image
from tactograph.rings.recording.files.stamps import day_offset_ns
from tactograph.rings.recording.nodes.record import RECORDING_FORMAT
from tactograph.sdk import ImageFile, InputError, Light, LiveState, SensorIdentity, node, warn
from tactograph.sdk.nodes import read_calibration, read_capture

IMAGE_TOPIC = re.compile(r"/(?:led(\d)|off|(colour))/image_raw")
RATE_FRAMES = 40
"""Frames from which the camera's rate is estimated."""
MAX_PAUSE_S = 1.0
"""Longer pauses, as between two recordings in one folder, are skipped."""


@node(endless=True)
def replay(
    *,
    recording: Path,
    calibration: Path | None = None,
    another_sensor: bool = False,
    speed: Annotated[float, Ge(0)] = 1.0,
    refresh: Refresh = "rolling",
) -> Iterator[LiveFrames]:
    """Yield the touches of a recording, assembled as in the live stream or differently.

    No touch is left out: a graph that is slower than `speed` falls behind.  A recording whose
    end is missing, as after a power cut, is replayed up to that point, with a warning.

    Parameters
    ----------
    recording : an ``.mcap`` file of `record`, or the folder of such files, which are read in order
    calibration
        A recording of another sensor than the calibration's is refused.  Of recordings with
        frames with all LEDs off it gives the camera's own dark image, which the graph subtracts
        by itself.
    another_sensor : take a recording of another sensor on purpose, with a warning
    speed : 1: at the recorded pace; 2: twice as fast; 0: as fast as possible
    refresh
        "rolling": a touch with every frame, each replacing the older one of its LED.
        "cycle": a touch whenever all LEDs are new.

    Returns
    -------
    Touches as `read_camera` yields them.  `time` is converted to this computer's present clock
    of ``time.monotonic()``, so it is negative for frames recorded before the clock's start.

    Raises
    ------
    InputError
        If there is no recording, a file was not written by `record`, or it is of another sensor
        than the calibration.
    """
    source = _Recording(
        recording, lambda sensor, file: sensor.check(file, calibration, another_sensor)
    )
    frames = source.frames()
    first = list(islice(frames, RATE_FRAMES))
    if not first:
        raise InputError(f"{recording}: holds no frame")
    one_shot = first[0].led == ALL_LIT
    every = _paced(source, chain(first, frames), _Pace(speed), one_shot)
    if not one_shot:
        yield from _flashed(source, every, first, calibration, refresh)
        return
    for frame in every:
        light = _colours(frame, source.state.settings)
        yield LiveFrames.counted(light, frame.time, [frame], source.state)


replay.handed_in(read_capture.check_handed_in)
replay.reads_ahead()


def _paced(
    source: _Recording, frames: Iterator[RawFrame], pace: _Pace, one_shot: bool
) -> Iterator[RawFrame]:
    """Count each frame, and yield it when it is due; refuse a mix of both kinds of sensor."""
    before: RawFrame | None = None
    for frame in frames:
        if (frame.led == ALL_LIT) != one_shot:
            raise InputError(
                f"{source.path}: holds frames of a one-shot sensor and of one whose LEDs flash; "
                "replay them apart"
            )
        pace.wait(frame.time)
        source.state.frames += 1
        if before is not None:
            source.state.dropped += max(frame.number - before.number - 1, 0)
        before = frame
        yield frame


def _flashed(
    source: _Recording,
    frames: Iterator[RawFrame],
    first: list[RawFrame],
    calibration: Path | None,
    refresh: Refresh,
) -> Iterator[LiveFrames]:
    """Yield the newest frames of all LEDs as touches."""
    new: list[RawFrame] = []
    assembler, shape = _assembler(source, first, calibration, refresh), first[0].data.shape
    for frame in frames:
        if frame.data.shape != shape:
            assembler, shape = _assembler(source, [frame], calibration, refresh), frame.data.shape
        new.append(frame)
        assembler.add(frame)
        if frame.led and assembler.due:
            light, moment = assembler.take(), assembler.newest.time
            yield LiveFrames.counted(light, moment, new, source.state)
            new = []


def _colours(frame: RawFrame, settings: dict[str, Any]) -> Light:
    """The lights of a one-shot sensor's frame, in the order used while recording."""
    top = top_of(frame.data, full_scale(settings.get("bits")))
    return planes_of(frame.data, "rgb" if settings.get("lights") == "rgb" else "bgr", top)


class _Recording:
    """The frames of one or several files, and the data stored with them.

    Attributes
    ----------
    path : the file, or the folder
    leds : number of LEDs; known from the first frame on
    state : the counters, with the camera's settings as far as they have been read
    """

    def __init__(self, path: Path, check: Callable[[SensorIdentity, Path], None]) -> None:
        self.path, self._check = path, check
        self._sensor = SensorIdentity()
        self._files = _files(path)
        self._offset = day_offset_ns()
        self.leds = 0
        self.state = LiveState()

    def frames(self) -> Iterator[RawFrame]:
        """Yield the frames in the order of the files; warn of lost data."""
        for path in self._files:
            file = McapReader(path)
            count = 0
            for message in file.messages():
                if topic := IMAGE_TOPIC.fullmatch(message.topic):
                    if not count:
                        self._learn(file)
                    count += 1
                    yield self._frame(path, message, topic)
                elif message.topic == "/touch":
                    self._take_state(message)
            if not count and file.topics:
                topics = ", ".join(sorted(file.topics)[:4])
                raise InputError(f"{path}: is no recording of camera frames; it holds {topics}")
            if file.lost or not file.has_end or not count:
                why = "is damaged" if file.has_end else "ends early, as after a power cut"
                warn(f"{path}: {why}: {file.lost} bytes cannot be read; {count} frames can")

    def _learn(self, file: McapReader) -> None:
        leds = file.about.get("leds", "")
        if leds not in map(str, range(1, 9)):
            raise InputError(f"{file.path}: was not written by tactograph's 'record'")
        if file.about.get("format") != RECORDING_FORMAT:
            raise InputError(
                f"{file.path}: is of format {file.about.get('format')}, this version reads "
                f"{RECORDING_FORMAT}"
            )
        self.leds = int(file.about["leds"])
        sensor = SensorIdentity.stated_in(file.about)
        if sensor != self._sensor:
            self._check(sensor, file.path)
        self._sensor = sensor

    def _frame(self, path: Path, message: McapMessage, topic: re.Match[str]) -> RawFrame:
        try:
            data = read_image(message.body)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        led = ALL_LIT if topic[2] else int(topic[1] or 0)
        is_of_kind = (data.ndim > 2) == (led == ALL_LIT) and led <= self.leds
        if not is_of_kind or data.dtype.kind != "u" or not 0 < data.size <= ImageFile.MAX_PIXELS:
            raise InputError(
                f"{path}: {message.topic} holds {data.dtype} numbers of shape {data.shape}, which "
                f"no camera above {self.leds} LEDs gives"
            )
        return RawFrame(message.sequence, led, 1e-9 * (message.time - self._offset), data)

    def _take_state(self, message: McapMessage) -> None:
        try:
            state = json.loads(message.body.data)["state"]
            settings = None if state is None else dict(state["settings"])
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            return  # a touch without readable settings is no reason to stop
        if settings is not None and settings.get("bits") in (None, *range(1, 17)):
            self.state.settings = settings


class _Pace:
    """Paces a recording at a given speed."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._begin: tuple[float, float] | None = None
        self._before = 0.0

    def wait(self, recorded: float) -> None:
        """Wait until a frame that was exposed at `recorded` is due."""
        if not self._speed:
            return
        now = time.monotonic()
        pause = recorded - self._before
        if self._begin is None or not -MAX_PAUSE_S < pause < MAX_PAUSE_S:
            self._begin = now, recorded
        self._before = recorded
        began, first = self._begin
        time.sleep(max(began + (recorded - first) / self._speed - now, 0.0))


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise InputError(f"{path}: there is no such recording")
    if not path.is_dir():
        return [path]
    files = log_files(path) or sorted(path.glob("*.mcap"))
    if not files:
        raise InputError(f"{path}: holds no .mcap file, so no recording")
    return files


def _assembler(
    source: _Recording, frames: list[RawFrame], calibration: Path | None, refresh: Refresh
) -> Assembler:
    """An assembler for such frames; since it is not asked for motion, any film will do."""
    shape = frames[0].data.shape
    dark = np.zeros(shape, np.float32)
    if calibration is not None:
        dark = read_calibration(file=calibration).dark
        if dark.shape != shape:
            raise InputError(
                f"{calibration}: is for {dark.shape[1]} x {dark.shape[0]} pixels, "
                f"but the recording has {shape[1]} x {shape[0]}"
            )
    leds = range(1, source.leds + 1)
    off = [0] if any(frame.led == 0 for frame in frames) else []
    film = make_film(np.ones((source.leds, *shape), np.float32))
    # Frames per second, from their times and numbers.
    pairs = [(a, b) for a, b in pairwise(frames) if b.number > a.number]
    steps = [(b.time - a.time) / (b.number - a.number) for a, b in pairs]
    rate = 1 / max(median(steps or [0.1]), 1e-4)
    full = full_scale(source.state.settings.get("bits"))
    return Assembler(film, dark, (*leds, *off), rate, refresh, full)
