"""Light relative to a plane film, where the film at rest is none."""

from typing import Any

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import Light


@node(neutral="light", tolerance=Close(1e-6, 1e-5, why="division"))
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


@light_on_plane.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Light of a film that is lit everywhere."""
    return {"share": rng.uniform(0.3, 1.5, (K, H, W)).astype(np.float32)}
