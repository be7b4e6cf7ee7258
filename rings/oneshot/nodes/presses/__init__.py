"""Calibrate one-shot sensors, whose coloured LEDs are all lit at once."""

from typing import Annotated

from tactograph.sdk import F4, Port

PressImages = Annotated[F4, Port("P K H W", "1")]
"""P captures of K lights, each as a fraction of full scale."""
Circles = Annotated[F4, Port("B 3", "px")]
"""Contact circles: x, y, radius; a radius of 0 where no ball was found."""
