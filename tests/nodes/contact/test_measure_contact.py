"""Contacts of shapes whose area, volume, place and axes are known."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import Height
from tactograph.nodes.contact.find_contact import find_contact
from tactograph.nodes.contact.measure_contact import measure_contact
from tactograph.nodes.optics.camera_view import View

PIXEL = 0.02
ROWS, COLUMNS = 240, 320


def places(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Offsets of all pixels in mm from (x, y), which counts from the image's centre."""
    rows, columns = np.indices((ROWS, COLUMNS))
    return (columns - (COLUMNS - 1) / 2) * PIXEL - x, (rows - (ROWS - 1) / 2) * PIXEL - y


def cap(x: float, y: float, radius: float, depth: float) -> Height:
    """A ball of a radius, pressed in by a depth; all in mm."""
    right, down = places(x, y)
    squares = np.maximum(radius**2 - right**2 - down**2, 0)
    return np.maximum(np.sqrt(squares) - (radius - depth), 0).astype(np.float32)


def ellipse(x: float, y: float, major: float, minor: float, angle: float) -> Height:
    """A plateau with such axes, in mm and degrees from x towards y."""
    right, down = places(x, y)
    turn = np.radians(angle)
    along, across = (
        right * np.cos(turn) + down * np.sin(turn),
        down * np.cos(turn) - right * np.sin(turn),
    )
    inside = (2 * along / major) ** 2 + (2 * across / minor) ** 2 <= 1
    return np.where(inside, 0.1, 0).astype(np.float32)


def test_a_spherical_cap_has_its_known_figures() -> None:
    radius, depth = 4.0, 0.3
    height = cap(0.4, -0.7, radius, depth)
    figures = measure_contact(height, find_contact(height, least_error_mm=1e-5), PIXEL)
    area = np.pi * (2 * radius * depth - depth**2)
    volume = np.pi * depth**2 * (radius - depth / 3)
    assert figures["contacts"] == 1
    assert figures["contact_area_mm2/c1"] == pytest.approx(area, rel=0.005)
    assert figures["contact_volume_mm3/c1"] == pytest.approx(volume, rel=0.005)
    assert figures["contact_depth_mm/c1"] == pytest.approx(depth, rel=0.002)
    assert figures["contact_mean_depth_mm/c1"] == pytest.approx(volume / area, rel=0.005)
    assert figures["contact_major_mm/c1"] == pytest.approx(2 * np.sqrt(area / np.pi), rel=0.005)
    assert figures["contact_minor_mm/c1"] == pytest.approx(2 * np.sqrt(area / np.pi), rel=0.005)
    assert figures["contact_x_mm/c1"] == pytest.approx(0.4, abs=0.003)
    assert figures["contact_y_mm/c1"] == pytest.approx(-0.7, abs=0.003)
    assert figures["contact_x_px/c1"] == pytest.approx(159.5 + 20, abs=0.15)
    assert figures["contact_y_px/c1"] == pytest.approx(119.5 - 35, abs=0.15)


def test_two_balls_are_two_contacts() -> None:
    height = cap(-1.5, 0.5, 2.0, 0.3) + cap(1.5, -0.4, 3.0, 0.2)
    figures = measure_contact(height, find_contact(height), PIXEL)
    assert figures["contacts"] == 2
    assert figures["contact_depth_mm/c1"] == pytest.approx(0.2, rel=0.01)
    assert figures["contact_depth_mm/c2"] == pytest.approx(0.3, rel=0.01)
    assert figures["contact_x_mm/c1"] == pytest.approx(1.5, abs=0.01)
    assert figures["contact_x_mm/c2"] == pytest.approx(-1.5, abs=0.01)


@pytest.mark.parametrize("angle", [-60.0, 0.0, 25.0, 90.0])
def test_a_tilted_ellipse_has_its_known_axes(angle: float) -> None:
    height = ellipse(0.3, 0.2, 3.0, 1.2, angle)
    figures = measure_contact(height, find_contact(height), PIXEL)
    assert figures["contact_major_mm/c1"] == pytest.approx(3.0, rel=0.005)
    assert figures["contact_minor_mm/c1"] == pytest.approx(1.2, rel=0.005)
    apart = (figures["contact_angle_deg/c1"] - angle + 90) % 180 - 90
    assert apart == pytest.approx(0, abs=0.3)
    assert -90 < figures["contact_angle_deg/c1"] <= 90


def test_a_contact_at_the_corner_is_measured_as_far_as_it_is_visible() -> None:
    height = np.zeros((ROWS, COLUMNS), np.float32)
    height[:10, :30] = 0.1
    figures = measure_contact(height, find_contact(height), PIXEL)
    assert figures["contact_area_mm2/c1"] == pytest.approx(300 * PIXEL**2)
    assert figures["contact_volume_mm3/c1"] == pytest.approx(30 * PIXEL**2)
    assert (figures["contact_x_px/c1"], figures["contact_y_px/c1"]) == (14.5, 4.5)
    assert figures["contact_major_mm/c1"] == pytest.approx(4 * 30 / np.sqrt(12) * PIXEL)


@pytest.mark.parametrize(
    ("x", "y", "cut"),
    [(0, 0, False), (2.7, 0, True), (-2.7, 0, True), (0, 1.9, True), (0, -1.9, True)],
)
def test_a_contact_that_the_border_cuts_is_marked(x: float, y: float, cut: bool) -> None:
    height = cap(x, y, 2.0, 0.2)
    figures = measure_contact(height, find_contact(height), PIXEL)
    assert figures["contact_cut/c1"] is cut
    full = measure_contact(cap(0, 0, 2.0, 0.2), find_contact(cap(0, 0, 2.0, 0.2)), PIXEL)
    for name in ("area_mm2", "depth_mm", "volume_mm3"):
        assert figures[f"contact_{name}/c1"] <= full[f"contact_{name}/c1"] * 1.001


@pytest.mark.parametrize("wide", [1, 2, 3])
@pytest.mark.parametrize("tall", [1, 2, 40])
def test_a_contact_of_few_columns_or_rows_is_measured_like_any_other(wide: int, tall: int) -> None:
    height = np.zeros((ROWS, COLUMNS), np.float32)
    height[100 : 100 + tall, 50 : 50 + wide] = 0.1
    figures = measure_contact(height, (height > 0).astype(np.uint8), PIXEL)
    assert figures["contact_area_mm2/c1"] == pytest.approx(wide * tall * PIXEL**2)
    assert figures["contact_volume_mm3/c1"] == pytest.approx(0.1 * wide * tall * PIXEL**2)
    assert figures["contact_x_px/c1"] == pytest.approx(50 + (wide - 1) / 2)
    assert figures["contact_y_px/c1"] == pytest.approx(100 + (tall - 1) / 2)
    assert figures["contact_major_mm/c1"] == pytest.approx(
        4 * max(wide, tall) / np.sqrt(12) * PIXEL
    )


def test_no_contact_is_a_figure_too() -> None:
    level = np.zeros((ROWS, COLUMNS), np.float32)
    assert measure_contact(level, find_contact(level), PIXEL) == {"contacts": 0.0}


def test_all_contacts_count_and_the_largest_are_measured() -> None:
    height = np.zeros((ROWS, COLUMNS), np.float32)
    for number in range(63):
        side = 12 if number in (40, 7) else 8
        y, x = 25 * (number // 9), 30 * (number % 9)
        height[y : y + side, x : x + side] = 0.1
    height[3:11, 33:41] = 0.1  # by the first of the second column: the third largest
    contact = find_contact(height)
    with collect_warnings([]) as notes:
        figures = measure_contact(height, contact, PIXEL, most=3)
    assert figures["contacts"] == contact.max() == 63
    areas = [name for name in figures if name.startswith("contact_area")]
    assert areas == [f"contact_area_mm2/c{number}" for number in (1, 2, 3)]
    assert notes == [
        "of all contacts (figure 'contacts') only the 3 largest are measured; `most` sets how many"
    ]


@pytest.mark.parametrize("lens", [None, [-0.1, 0.02, 0.02, -0.01, 0.03, 0.01, 0.02, 0.01]])
@pytest.mark.parametrize("camera", [0.0, 1 / 50])
def test_places_and_areas_are_those_on_the_film(lens: list[float] | None, camera: float) -> None:
    """A dome far from the middle, as a lens from near shows it, and on an even grid."""
    shown = cap(1.6, 1.0, 1.0, 0.4)
    view = View(None if lens is None else np.array(lens, np.float32), camera)
    even = np.nan_to_num(View(view.lens, camera).on_even_grid(shown, [])[0])
    measured, true = (
        measure_contact(height, (height > 0.005).astype(np.uint8), PIXEL, view)
        for height, view in ((shown, view), (even, View()))
    )
    for name in "area_mm2", "volume_mm3", "major_mm", "minor_mm", "depth_mm", "mean_depth_mm":
        assert measured[f"contact_{name}/c1"] == pytest.approx(true[f"contact_{name}/c1"], rel=0.01)
    for name in "x_mm", "y_mm":
        assert measured[f"contact_{name}/c1"] == pytest.approx(true[f"contact_{name}/c1"], abs=0.03)


def test_a_contact_on_a_curved_film_is_measured_along_it() -> None:
    """On a film that slopes by 0.75, seen from near: a plate of 0.1 mm along the camera's axis."""
    right, _ = places(0, 0)
    camera, slope = 1 / 50, 0.75
    rest = (slope * right / (1 + camera * slope * right)).astype(np.float32)
    height = ellipse(0, 0, 2.0, 2.0, 0.0)
    measured = measure_contact(
        height, (height > 0).astype(np.uint8), PIXEL, View(None, camera), rest
    )
    assert measured["rest_relief_mm"] == pytest.approx(np.ptp(rest), rel=1e-5)
    assert measured["contact_normal_depth_mm/c1"] == pytest.approx(0.1 * 0.8, rel=1e-3)
    assert measured["contact_film_area_mm2/c1"] == pytest.approx(np.pi / 0.8, rel=0.01)
    assert measured["contact_volume_mm3/c1"] == pytest.approx(0.1 * np.pi, rel=0.01)
