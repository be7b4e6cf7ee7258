"""Decide whether a film lights itself."""

from tactograph.graph import node
from tactograph.nodes import Albedo


@node
def lights_itself(albedo: Albedo) -> bool:
    """Return whether light from film to film matters: `albedo`, a share of light, is not zero."""
    return albedo > 0
