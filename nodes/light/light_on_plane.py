"""Light relative to a plane film, where the film at rest is none."""

from tactograph.graph import node
from tactograph.nodes import Light


@node(neutral="light")
def light_on_plane(light: Light, share: Light | None = None, *, away: bool = False) -> Light:
    """Multiply light relative to the film at rest by the film's own over that of a plane (F5).

    Parameters
    ----------
    light : K x H x W
    share : K x H x W, r as `untouched_film` returns it; None: the film at rest is a plane
    away : whether light relative to a plane is made relative to the film at rest
    """
    if share is None:
        return light
    return light / share if away else light * share


light_on_plane.opencl(grid="K H W", lanes="grid")


@light_on_plane.idle
def _is_plane(share: Light | None = None) -> bool:
    """Return whether the film at rest is a plane: nothing says otherwise."""
    return True
