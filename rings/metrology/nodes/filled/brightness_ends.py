"""The two ends of what may be known of a film's brightness."""

from typing import Annotated, NamedTuple

from tactograph.sdk import Port, node

HELD_UNEVEN, FREE_UNEVEN = 0.0005, 0.2
"""Standard deviations of the film's brightness that leave slopes no freedom, and all."""


class BrightnessEnds(NamedTuple):
    """Standard deviations of the brightness for `label_lights`."""

    held: Annotated[float, Port(unit="1")]
    free: Annotated[float, Port(unit="1")]


@node
def brightness_ends() -> BrightnessEnds:
    """Return how uneven film is whose brightness is known, and whose is any."""
    return BrightnessEnds(HELD_UNEVEN, FREE_UNEVEN)
