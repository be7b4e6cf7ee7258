"""The film at rest comes from a drawing: a form, a height map or a mesh."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.find_film import find_film
from tactograph.nodes.files.height_files import write_ply
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.rings.curved_film.nodes.read_rest import read_rest

PIXEL_MM, SIZE = 0.1, (60, 80)
STRAIGHT = np.zeros(8, np.float32)


def read(**arguments: Any) -> Any:
    return read_rest(np.zeros((4, *SIZE), np.float32), PIXEL_MM, STRAIGHT, **arguments)


def places() -> tuple[F4, F4]:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    return (x - (SIZE[1] - 1) / 2) * PIXEL_MM, (y - (SIZE[0] - 1) / 2) * PIXEL_MM


@pytest.mark.parametrize("radius", [12.0, -12.0])
def test_a_ball_curves_up_or_down(radius: float) -> None:
    x, y = places()
    expected = np.sign(radius) * (12 - np.sqrt(144 - x * x - y * y))
    np.testing.assert_allclose(read(radius_mm=radius).shape.height, expected, atol=1e-5)


def test_a_cylinder_is_straight_along_its_axis() -> None:
    height = read(cylinder_mm=(12.0, 90.0)).shape.height
    np.testing.assert_allclose(height, np.broadcast_to(height[:1], SIZE), atol=1e-6)
    assert height[0, 0] > 0.5


def test_rays_of_a_near_camera_meet_the_form() -> None:
    height = read(radius_mm=12.0, camera_mm=30.0).shape.height
    x, y = (place * (1 - height / 30) for place in places())
    np.testing.assert_allclose(x * x + y * y + (12 - height) ** 2, 144, rtol=1e-5)


def test_slopes_of_the_film_are_those_of_its_form_under_a_near_camera() -> None:
    shape = read(radius_mm=12.0, camera_mm=30.0).shape
    x, y = (place * (1 - shape.height / 30) for place in places())
    inner = (slice(2, -2), slice(2, -2))
    for found, along in zip(shape.slope, (x, y), strict=True):
        np.testing.assert_allclose(found[inner], (along / (12 - shape.height))[inner], atol=2e-3)


@pytest.mark.parametrize("camera_mm", [None, 30.0])
def test_a_mesh_gives_the_height_map_it_was_built_from(
    camera_mm: float | None, tmp_path: Path
) -> None:
    pytest.importorskip("trimesh")
    y, x = (np.mgrid[:100, :120].astype(np.float32) - np.array([49.5, 59.5])[:, None, None]) * 0.1
    write_ply(tmp_path / "gel.ply", np.float32(14) - np.sqrt(196 - x * x - y * y), 0.1)
    arguments = {"camera_mm": camera_mm}
    mesh = read(file=tmp_path / "gel.ply", **arguments).shape.height
    np.testing.assert_allclose(mesh, read(radius_mm=14.0, **arguments).shape.height, atol=2e-4)


def test_a_height_map_gives_the_height_that_each_pixel_sees(tmp_path: Path) -> None:
    height = np.random.default_rng(1).random(SIZE).astype(np.float32)
    np.save(tmp_path / "gel.npy", height)
    np.testing.assert_array_equal(read(file=tmp_path / "gel.npy").shape.height, height)


def test_film_hidden_by_its_own_curvature_is_left_out() -> None:
    """From near, rays beyond a ball's horizon meet nothing; the area of the film ends there."""
    radius, pupil = 10.0, 5.0
    shape, visible = read(radius_mm=-radius, camera_mm=pupil)
    assert visible is not None
    # The tangent from the pupil, above the ball's top, meets height 0 this far out.
    horizon = pupil * np.tan(np.arcsin(radius / (radius + pupil)))
    far = np.hypot(*places()) / horizon
    assert not visible[far > 1.02].any()
    assert visible[far < 0.98].all()
    assert np.isfinite(shape.height).all()
    area = find_film(np.ones((4, *SIZE), np.float32), visible).area
    np.testing.assert_array_equal(area, visible)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "needs one of them"),
        ({"radius_mm": 2.0}, "sees no film"),
        ({"radius_mm": 9.0, "cylinder_mm": 9.0}, "one shape"),
        ({"radius_mm": 0.0}, "not 0"),
        ({"radius_mm": 9.0, "at_mm": (0.0, 0.0, 6.0), "camera_mm": 5.0}, "pupil|sees no film"),
    ],
)
def test_a_form_that_no_film_has_is_refused(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(**arguments)


def test_a_height_map_of_another_size_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "gel.npy", np.zeros((5, 5)))
    with pytest.raises(InputError, match="5 x 5 pixels"):
        read(file=tmp_path / "gel.npy")


def test_a_height_map_in_micrometres_is_refused(tmp_path: Path) -> None:
    """It gave NumPy's warnings, and no film had the light of the balls."""
    x, y = places()
    np.save(tmp_path / "gel.npy", 1e3 * 0.02 * (x * x + y * y))
    with pytest.raises(InputError, match=r"gel\.npy: the film at rest rises by .* is it in mm"):
        read(file=tmp_path / "gel.npy")


def test_cells_of_a_shape_have_its_means() -> None:
    shape = RestShape.of(read(radius_mm=12.0).shape.height, PIXEL_MM)
    cells = shape.binned(4)
    means = shape.slope[:, 12:16, 20:24].mean((1, 2))
    np.testing.assert_allclose(cells.slope[:, 3, 5], means, atol=1e-6)
    assert cells.pixel == pytest.approx(0.4)
