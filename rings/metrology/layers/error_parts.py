"""The parts of the height's error, on cells, where a known step has settled the scale."""

from tactograph.rings.metrology.nodes.surface.measure_step import ErrorParts
from tactograph.sdk import LayerKind

KIND = LayerKind(ErrorParts)
