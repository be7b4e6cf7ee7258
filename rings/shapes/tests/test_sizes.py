"""A shape that would be too large is refused before it is made."""

from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.rings.shapes.nodes.shape_mesh import shape_mesh
from tactograph.rings.shapes.nodes.shape_text import shape_text


@pytest.mark.parametrize(
    "make",
    [
        lambda: shape_mesh(file=Path("none.stl"), width_px=16384, height_px=16384),
        lambda: shape_text(text="large", size_mm=1e4, pixel_size_mm=1e-4),
    ],
)
def test_sizes_beyond_memory_or_patience_are_refused(make) -> None:
    with pytest.raises(InputError, match=r"million|fine pixels|px"):
        make()
