"""Frames, and recordings of them, for the tests of what records, replays and shows streams."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph import Provenance, Session
from tactograph.nodes import F4
from tactograph.nodes.stream.touch import LiveState
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapReader
from tactograph.rings.recording.nodes.record import record

SIZE = (24, 32)
LEDS = 4
RATE = 30.0
PROVENANCE = Provenance(
    graph={"name": "toy", "title": "", "hash": "0"}, device=None,
    nodes=[{"node": "height", "op": "height", "backend": "numpy", "once": False, "ms": 2.5}],
    sizes={}, versions={"tactograph": "0"}, warnings=[], fallbacks=[],
)  # fmt: skip


def make_frame(number: int, *, dtype: Any = np.uint8, began: float = 1000.0) -> RawFrame:
    """Frame `number` of an even cycle; its pixels are its own."""
    rng = np.random.default_rng(number)
    data = rng.integers(0, np.iinfo(dtype).max, SIZE).astype(dtype)
    return RawFrame(number, 1 + number % LEDS, began + number / RATE, data)


def make_cycle(touch: int, **how: Any) -> list[RawFrame]:
    """The frames of one touch, one of every LED."""
    return [make_frame(LEDS * touch + k, **how) for k in range(LEDS)]


def light_of(frames: list[RawFrame]) -> F4:
    """The touch that `frames` make up; one of all LEDs off is no part of it."""
    by_led = sorted((f for f in frames if f.led), key=lambda frame: frame.led)
    return np.stack([f.data / np.float32(np.iinfo(f.data.dtype).max) for f in by_led])


def record_touch(
    session: Session, frames: list[RawFrame], name: str, bits: int | None = None, **settings: Any
) -> None:
    state = LiveState(frames=frames[-1].number, settings={"exposure": 12, "bits": bits})
    state.faults["lost"] = 2
    light = light_of(frames)
    record(frames, light, name, state, provenance=PROVENANCE, session=session, **settings)


def record_cycles(folder: Path, *cycles: list[RawFrame], **settings: Any) -> None:
    """Record touches into `folder`, each by its frames."""
    session = Session()
    for number, frames in enumerate(cycles):
        record_touch(session, frames, f"{number:06}", folder=folder, **settings)
    session.close()


def make_recording(folder: Path, touches: int, **settings: Any) -> list[RawFrame]:
    """Record so many touches into `folder`; the frames that are in it then."""
    began = time.monotonic()
    cycles = [make_cycle(touch, began=began) for touch in range(touches)]
    record_cycles(folder, *cycles, **settings)
    return [frame for cycle in cycles for frame in cycle]


def read_numbers(folder: Path) -> list[int]:
    """The numbers of all frames that can be read, in order."""
    return [
        message.sequence
        for path in log_files(folder)
        for message in McapReader(path).messages()
        if message.topic.endswith("image_raw")
    ]
