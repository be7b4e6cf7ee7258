"""The pressure on the film; a stream carries it in pascals."""

from tactograph.rings.mechanics.nodes.force.press_to_pressure import Pressure
from tactograph.sdk import ColourMap, LayerKind, Touch

PASCALS_PER_KPA = 1e3


def _in_pascals(touch: Touch, pressure: Pressure) -> Pressure:
    return PASCALS_PER_KPA * pressure


KIND = LayerKind(
    Pressure,
    ColourMap("pressure on the film", "kPa"),
    topics={"pressure": _in_pascals},
    follows_film=True,
)
