"""A grating repeats."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.rings.shapes.nodes.shape_grating import shape_grating

AREA = {"width_px": 401, "height_px": 401, "pixel_size_mm": 0.02, "side_mm": 6.0}


@pytest.mark.parametrize(("profile", "mean"), [("square", 0.5), ("triangle", 0.25), ("sine", 0.25)])
def test_mean_height_of_each_profile(profile, mean):
    height, pixel = shape_grating(profile=profile, period_mm=1.0, rise_mm=0.8, **AREA)
    assert height.sum() * pixel**2 == pytest.approx(36 * 0.8 * mean, rel=0.03)
    assert height.max() == pytest.approx(0.8, rel=1e-3)


@pytest.mark.parametrize("profile", ["square", "triangle", "sine"])
def test_profile_repeats_with_the_period(profile):
    row = shape_grating(profile=profile, period_mm=1.0, **AREA).height[200]
    np.testing.assert_allclose(row[100:250], row[150:300], atol=1e-5)


def test_duty_is_the_share_of_the_ridges():
    row = shape_grating(period_mm=1.0, duty=0.3, **AREA).height[200, 75:325]
    assert np.mean(row > 0) == pytest.approx(0.3, abs=0.03)


def test_ridges_run_across_the_angle():
    height = shape_grating(angle_deg=90.0, period_mm=1.03, **AREA).height
    assert (np.ptp(height[80:320, 80:320], axis=1) == 0).all()


@pytest.mark.parametrize(
    ("more", "why"),
    [({"profile": "sine"}, "a sine has no walls"), ({"period_mm": 1.0}, "leaves no level")],
)
def test_walls_need_levels_between_them(more: dict[str, object], why: str) -> None:
    with pytest.raises(InputError, match=why):
        shape_grating(wall_deg=40.0, **more)
