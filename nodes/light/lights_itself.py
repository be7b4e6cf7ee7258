"""Whether a film lights itself."""

from tactograph.graph import node
from tactograph.nodes import Albedo


@node
def lights_itself(albedo: Albedo) -> bool:
    """Return whether the film throws any of its light on other places of it."""
    return albedo > 0
