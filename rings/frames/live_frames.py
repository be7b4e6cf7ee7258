"""Camera frames with their LED, and the touches made of them."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import Height, Labels, Light, LiveState, Port, Slope

ALL_LIT = -1
"""Stands for an LED's number where all LEDs, each of another colour, are lit."""


@dataclass(frozen=True)
class RawFrame:
    """One raw camera frame.

    `number` is counted by the camera, so that a gap means dropped frames.  `led` is the lit LED,
    from 1; 0 if all were off, or ALL_LIT in a one-shot sensor.  `time` is the end of the
    exposure in seconds of ``time.monotonic()``.  `data` is H x W, 8 or 16 bit; for a one-shot
    sensor H x W x 3 in the order of the camera's driver.
    """

    number: int
    led: int
    time: float
    data: NDArray[np.uint8] | NDArray[np.uint16]


class LiveFrames(NamedTuple):
    """The newest light of every LED or colour, and its new frames.

    True slopes and shadows are never known live; the fields exist so that a camera can replace
    `read_capture` anywhere.
    """

    image: Light
    name: str
    time: Annotated[float, Port(unit="s")]
    new: list[RawFrame]
    state: LiveState
    truth: Height | None = None
    truth_slope: Slope | None = None
    truth_shadow: Labels | None = None
    truth_rest: Height | None = None

    @classmethod
    def counted(
        cls,
        image: Light,
        time: float,
        new: list[RawFrame],
        state: LiveState,
        truth: Height | None = None,
    ) -> Self:
        """Return the next touch of a stream, which its `state` counts."""
        state.touches += 1
        now = replace(state, faults=Counter(state.faults))
        return cls(image, f"{state.touches:06}", time, new, now, truth)
