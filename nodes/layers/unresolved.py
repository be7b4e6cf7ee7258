"""Where light leaves the height open."""

from typing import Annotated

from tactograph.nodes import Mask
from tactograph.nodes.stream.touch import LayerKind

KIND = LayerKind(Annotated[Mask, "1 where light leaves the height open"])
