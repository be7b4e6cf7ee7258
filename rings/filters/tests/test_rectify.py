"""A rectangle seen askew becomes one of its true size in the middle of the image."""

import cv2
import numpy as np
import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import Case
from tactograph.graph.declare.check_settings import model_of
from tactograph.rings.filters.nodes.rectify import Corners, rectify

SEEN: Corners = ((14.0, 9.0), (47.0, 12.0), (52.0, 40.0), (10.0, 36.0))


def test_a_rectangle_of_two_by_one_mm_covers_so_many_pixels_around_the_middle() -> None:
    outline = np.zeros((480, 640), np.uint8)
    cv2.fillConvexPoly(outline, np.int32(np.multiply(SEEN, 10)), 1)
    found = rectify(
        outline[None].astype(np.float32), 0.01, width_mm=2.0, height_mm=1.0,
        corners=tuple((10 * x, 10 * y) for x, y in SEEN),
    )  # fmt: skip
    rows, columns = np.nonzero(found[0] > 0.5)
    assert np.ptp(columns) == pytest.approx(200, abs=2)
    assert np.ptp(rows) == pytest.approx(100, abs=2)
    assert (rows.mean(), columns.mean()) == pytest.approx((239.5, 319.5), abs=1)


def test_a_frame_that_shows_the_rectangle_already_does_not_change() -> None:
    light = np.random.default_rng(1).random((2, 20, 30), np.float32)
    found = rectify(light, 0.1, width_mm=3.0, height_mm=2.0)
    np.testing.assert_allclose(found, light, atol=1e-5)


@pytest.mark.parametrize("size_mm", [(3.0, 2.0), (0.4, 0.3)])
def test_back_ends_agree_on_a_rectangle_askew(device: OpenCL, size_mm: tuple[float, float]) -> None:
    """The second reaches far beyond the rectangle: to the frame's border and the horizon."""
    width, height = size_mm
    settings = {"width_mm": width, "height_mm": height, "corners": SEEN}
    case = Case({"K": 3, "H": 48, "W": 64}, "random", "askew", settings)
    assert compare(rectify, device, case) is None


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0], [0, 9], [9, 9], [9, 0]],
        [[0, 0], [9, 9], [9, 0], [0, 9]],
        [[0, 0], [9, 0], [3, 3], [0, 9]],
        [[0, 0], [0, 0], [9, 9], [0, 9]],
    ],
)
def test_corners_that_no_camera_sees_of_a_rectangle_are_refused(corners: object) -> None:
    with pytest.raises(ValueError, match="clockwise"):
        model_of(rectify).model_validate({"width_mm": 1.0, "height_mm": 1.0, "corners": corners})
