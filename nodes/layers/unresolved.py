"""Where light does not determine the height."""

from typing import Annotated

from tactograph.nodes import Mask
from tactograph.nodes.stream.touch import LayerKind

KIND = LayerKind(Annotated[Mask, "1 where light does not determine the height"])
