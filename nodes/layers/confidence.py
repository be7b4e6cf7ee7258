"""The probability that the shadow labels are right."""

from tactograph.nodes import Confidence
from tactograph.nodes.stream.touch import ColourMap, LayerKind

KIND = LayerKind(Confidence, ColourMap("shadow labels: probability of all", colours="gray"))
