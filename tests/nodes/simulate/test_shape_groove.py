"""A groove has the width, depth and walls that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.metrology.measure_step import measure_step
from tactograph.nodes.simulate.shape_groove import shape_groove


@pytest.mark.parametrize(("depth", "wall"), [(0.5, 40.0), (0.5, 75.0), (0.2, 20.0)])
@pytest.mark.parametrize("along", ["x", "y"])
def test_a_groove_measures_as_it_was_made(depth: float, wall: float, along: str) -> None:
    angle = 0.0 if along == "x" else 90.0
    made = shape_groove(width_mm=3.0, depth_mm=depth, wall_deg=wall, angle_deg=angle)
    middle = made.height[60:180, 80:240] if along == "x" else made.height[40:200, 100:220]
    found = measure_step(middle, made.pixel_size, along=along)
    assert found["step_depth_um"] == pytest.approx(1e3 * depth, abs=0.5)
    assert found["step_width_mm"] == pytest.approx(3.0, abs=0.02)
    if wall < 70:
        assert found["wall_1_deg"] == pytest.approx(wall, abs=1)


def test_its_bottom_is_the_plane_and_the_plate_stands_on_it() -> None:
    made = shape_groove(width_mm=3.0, depth_mm=0.5, side_mm=12.0)
    assert made.height.max() == pytest.approx(0.5)
    assert made.height[120, 160] == made.height[120, 0] == made.height[0, 160] == 0
    half = (made.height > 0.25).sum() * made.pixel_size**2
    assert half == pytest.approx(12 * 12 - 12 * 3, rel=0.02)


@pytest.mark.parametrize("more", [{"width_mm": 0.5}, {"side_mm": 4.0}])
def test_walls_that_leave_no_level_are_refused(more: dict[str, float]) -> None:
    with pytest.raises(InputError, match="leaves no level"):
        shape_groove(**more)


def test_a_vertical_wall_is_one_pixel_wide() -> None:
    made = shape_groove(wall_deg=90.0)
    assert set(np.unique(made.height)) <= {0.0, np.float32(0.25), np.float32(0.5)}
