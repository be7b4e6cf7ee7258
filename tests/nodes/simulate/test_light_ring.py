"""LEDs are placed as in the sensor's drawing."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tactograph.graph import InputError, load
from tactograph.nodes.simulate.light_ring import light_ring


@given(
    count=st.integers(3, 8),
    slant=st.floats(0, 80),
    azimuth=st.floats(-360, 360),
    distance=st.floats(1, 1000),
)
def test_ring_has_the_stated_slant_and_distance(count, slant, azimuth, distance):
    lights = light_ring(
        count=count, slant_deg=slant, first_azimuth_deg=azimuth, distance_mm=distance
    )
    assert lights.shape == (count, 3)
    assert lights.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), distance, rtol=1e-5)
    np.testing.assert_allclose(lights[:, 2], distance * np.cos(np.deg2rad(slant)), rtol=1e-5)


def test_azimuth_runs_from_right_to_down():
    lights = light_ring(slant_deg=45.0, first_azimuth_deg=0.0, distance_mm=np.sqrt(2))
    np.testing.assert_allclose(lights, [[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]], atol=1e-6)


def test_the_papers_prototype_and_finger_have_their_leds_in_place():
    prototype = light_ring(slant_deg=8.5308, distance_mm=202.237)
    np.testing.assert_allclose(np.hypot(*prototype[:, :2].T), 30, rtol=1e-3)
    np.testing.assert_allclose(prototype[:, 2], 200, rtol=1e-3)
    finger = light_ring(slant_deg=45.0, distance_mm=7.0711)
    np.testing.assert_allclose(np.hypot(*finger[:, :2].T), 5, rtol=1e-3)
    np.testing.assert_allclose(finger[:, 2], 5, rtol=1e-3)


def test_explicit_positions_replace_the_ring_and_impossible_ones_are_refused(
    tmp_path: Path,
) -> None:
    places = [(1.0, 2.0, 3.0), (-1.0, 2.0, 3.0), (0.0, -2.0, 4.0)]
    np.testing.assert_array_equal(light_ring(positions_mm=places), np.float32(places))
    turned = [(1.2e-15, 2.0, 3.0), (-1.0, 2.0, 3.0), (0.0, -2.0, 4.0)]  # 20 * cos(pi / 2) is no 0
    graph = {"format": 1, "extends": "simulate", "outputs": {"light": "scene.light"}}
    pipeline = load(graph, out=tmp_path)
    pipeline.set("lights", positions_mm=turned, slant_deg=-1.2e-15)
    for wrong, message in (
        ([*places, (1.0, 2.0, 1e-300)], "positions_mm: .* greater than 0, not 0"),
        ([*places, (1.0, 2.0, -3.0)], "positions_mm: .* greater than 0, not -3"),
        (places[:2], "at least 3 items"),
        (3 * places, "at most 8 items"),
    ):
        with pytest.raises(InputError, match=message):
            pipeline.set("lights", positions_mm=wrong)
