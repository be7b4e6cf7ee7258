"""Points lie on the film where the camera's rays meet it."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tactograph.graph import InputError, Provenance
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import write_ply
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.optics.lens import ideal_places
from tactograph.nodes.stream.touch import Touch
from tactograph.nodes.write.write_result import write_result

SHAPE = (120, 160)
PIXEL = 0.1
CAMERA = 1 / 65
BENT = np.float32([0.03, 0, 0, 0, 0, 0, 0, 0])
PROVENANCE = Provenance({}, None, [], {}, {}, [], [])


def hill(x: F4, y: F4) -> F4:
    """A height in mm over places in mm from the middle, steepest 1.2."""
    return np.asarray(2.0 * np.exp(-((x - 3) ** 2 + (y + 1) ** 2) / 4), np.float64)


def middle() -> tuple[float, float]:
    return (SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2


def apparent(lens: F4) -> F4:
    """The apparent height of the hill for a pinhole camera: z = hill(x), x = u (1 - z / D)."""
    column, row = ideal_places(lens, SHAPE)
    u, v = PIXEL * (column - middle()[0]), PIXEL * (row - middle()[1])
    z = np.zeros(SHAPE)
    for _ in range(60):
        z = hill(u * (1 - z * CAMERA), v * (1 - z * CAMERA))
    return np.float32(z)


@pytest.mark.parametrize("lens", [None, BENT], ids=["no lens", "bent"])
def test_points_lie_on_the_true_surface(lens: F4 | None) -> None:
    height = apparent(np.zeros(8, np.float32) if lens is None else lens)
    x, y = View(lens, CAMERA).places(height)
    surface = hill(PIXEL * x, PIXEL * y)
    assert np.abs(surface - height).max() < 1e-4
    x, y = View(lens, 0.0).places(height)
    away = hill(PIXEL * x, PIXEL * y)
    assert np.abs(away - height).max() > 0.05


@pytest.mark.parametrize("lens", [None, BENT], ids=["no lens", "bent"])
def test_an_even_grid_holds_the_surface_itself(lens: F4 | None) -> None:
    height = apparent(np.zeros(8, np.float32) if lens is None else lens)
    on_grid, (error,) = View(lens, CAMERA).on_even_grid(height, [height])
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    truth = hill(PIXEL * (column - middle()[0]), PIXEL * (row - middle()[1]))
    known = np.isfinite(on_grid)
    assert known.mean() > 0.9
    assert np.abs(on_grid - truth)[known].max() < 1e-3
    assert np.abs(error - truth)[known].max() < 5e-3
    assert np.isnan(error[~known]).all()


def test_a_height_that_no_pixel_sees_is_unknown() -> None:
    """A film 6.5 mm up fills nine tenths of the frame in each direction."""
    on_grid, _ = View(None, CAMERA).on_even_grid(np.full(SHAPE, 6.5, np.float32), [])
    assert np.isnan(on_grid[0]).all()
    assert np.abs(on_grid[8:-8, 10:-10] - 6.5).max() < 1e-5


def test_an_orthographic_camera_without_lens_changes_nothing() -> None:
    height = apparent(np.zeros(8, np.float32))
    on_grid, layers = View(np.zeros(8, np.float32), 0.0).on_even_grid(height, [])
    assert np.array_equal(on_grid, height)
    assert layers == []
    x, y = View(None, 0.0).places(height)
    assert np.array_equal(y + middle()[1], np.mgrid[: SHAPE[0], : SHAPE[1]][0])
    assert np.array_equal(x + middle()[0], np.mgrid[: SHAPE[0], : SHAPE[1]][1])


def test_a_film_that_reaches_the_camera_is_refused() -> None:
    high = np.full(SHAPE, 70, np.float32)
    for call in (
        lambda: View(None, CAMERA).places(high),
        lambda: View(None, CAMERA).on_even_grid(high, []),
    ):
        with pytest.raises(InputError, match="pupil is 65 mm above it; check its height"):
            call()


def test_the_points_of_a_mesh_lie_on_the_surface(tmp_path: Path) -> None:
    height = apparent(BENT)
    write_ply(tmp_path / "height.ply", height, PIXEL, View(BENT, CAMERA))
    vertices = trimesh.load(tmp_path / "height.ply", process=False).vertices
    x, y = vertices[:, 0], -vertices[:, 1]
    assert np.abs(hill(x, y) - vertices[:, 2]).max() < 1e-4


@pytest.mark.parametrize("grid", ["pixel", "metric"])
def test_a_result_is_on_the_pixels_or_on_an_even_grid_of_the_film(
    tmp_path: Path, grid: str
) -> None:
    height = apparent(BENT)
    image = np.ones((4, *SHAPE), np.float32)
    touch = Touch(height, image, PIXEL, view=View(BENT, CAMERA), layers={"error": 0.01 * height})
    write_result(touch, folder=tmp_path, grid=grid, ply=True, provenance=PROVENANCE)
    stored = np.load(tmp_path / "height.npy")
    even, (error,) = View(BENT, CAMERA).on_even_grid(height, [0.01 * height])
    expected = (height, 0.01 * height) if grid == "pixel" else (even, error)
    assert np.array_equal(stored, expected[0], equal_nan=True)
    assert np.array_equal(np.load(tmp_path / "error.npy"), expected[1], equal_nan=True)
    assert json.loads((tmp_path / "result.json").read_text())["grid"] == grid
    vertices = trimesh.load(tmp_path / "height.ply", process=False).vertices
    assert len(vertices) == np.isfinite(stored).sum()
    x, y = vertices[:, 0], -vertices[:, 1]
    assert np.abs(hill(x, y) - vertices[:, 2]).max() < 1e-3
