"""The two ends of what may be known of a film's brightness."""

from typing import NamedTuple

from tactograph.sdk import node
from tactograph.sdk.unstable import Uneven

HELD_UNEVEN, FREE_UNEVEN = 0.0005, 0.2
"""Standard deviations of the film's brightness that leave slopes no freedom, and all."""


class BrightnessEnds(NamedTuple):
    """Standard deviations of the brightness for `label_lights`."""

    held: Uneven
    free: Uneven


@node
def brightness_ends() -> BrightnessEnds:
    """Return how uneven film is whose brightness is known, and whose is any."""
    return BrightnessEnds(HELD_UNEVEN, FREE_UNEVEN)
