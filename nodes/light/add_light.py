"""Light that comes from several places at once."""

from tactograph.graph import node
from tactograph.nodes import Light


@node(neutral="light")
def add_light(light: Light, more: Light | None = None) -> Light:
    """Return the sum of two lights, such as that of the LEDs and what the film throws on itself.

    Parameters
    ----------
    light, more : K x H x W; without the second one the first is returned
    """
    return light if more is None else light + more


add_light.opencl(grid="K H W", lanes="grid")
