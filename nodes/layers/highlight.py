"""The LEDs that the film mirrors."""

from typing import Annotated

from tactograph.nodes import Labels
from tactograph.nodes.stream.touch import LabelMap, LayerKind

KIND = LayerKind(
    Annotated[Labels, "Bit k-1: the film mirrors LED k"], LabelMap("mirrored", leds=True)
)
