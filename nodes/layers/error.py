"""The height's standard deviation."""

from tactograph.nodes import UM_PER_MM, HeightError
from tactograph.nodes.stream.touch import ColourMap, LayerKind

ERROR_MAP = ColourMap(
    "standard deviation of the height", "µm", "magma", UM_PER_MM, logarithmic=True
)
KIND = LayerKind(HeightError, ERROR_MAP, follows_film=True, is_deviation=True)
