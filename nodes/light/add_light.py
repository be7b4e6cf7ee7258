"""Add lights of different origin."""

from tactograph.graph import node
from tactograph.nodes import Light


@node(neutral="light")
def add_light(light: Light, more: Light | None = None) -> Light:
    """Return the sum of two lights, such as that of the LEDs and that from film to film.

    Parameters
    ----------
    light, more : K x H x W; without `more`, `light` is returned
    """
    return light if more is None else light + more


add_light.opencl(grid="K H W", lanes="grid")
