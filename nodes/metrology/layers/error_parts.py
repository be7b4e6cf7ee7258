"""The parts of the height's error, on cells, where a known step has settled the scale."""

from tactograph.nodes.metrology.measure_step import ErrorParts
from tactograph.nodes.stream.touch import LayerKind

KIND = LayerKind(ErrorParts)
