"""Make light relative to a plane, for a film at rest that is not a plane."""

from typing import Any

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import Light


@node(neutral="light", tolerance=Close(1e-6, 1e-5, why="division"))
def light_on_plane(light: Light, share: Light | None = None, *, inverse: bool = False) -> Light:
    """Multiply light relative to the film at rest by r, that film's light over a plane's (F5).

    Parameters
    ----------
    light : K x H x W
    share : K x H x W, r from `untouched_film`; None: the film at rest is a plane
    inverse : whether to make light relative to the film at rest instead, by division
    """
    if share is None:
        return light
    return light / share if inverse else light * share


light_on_plane.opencl(grid="K H W", lanes="grid")
light_on_plane.idle(lambda share=None: True)  # asked only without `share`


@light_on_plane.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Light of a film that is lit everywhere."""
    return {"share": rng.uniform(0.3, 1.5, (K, H, W)).astype(np.float32)}
