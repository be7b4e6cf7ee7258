"""Images averaged in cells of several pixels, and heights enlarged back to pixels."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import Case
from tactograph.nodes import F4
from tactograph.nodes.height.enlarge_height import enlarge_height
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.coarsen_dark import coarsen_dark
from tactograph.nodes.light.coarsen_pixel import coarsen_pixel


def like(rows: int, columns: int) -> F4:
    return np.zeros((3, rows, columns), np.float32)


def test_a_cell_is_the_mean_of_its_pixels_or_its_first_one() -> None:
    light = np.random.default_rng(0).random((4, 11, 7), np.float32)
    cells = coarsen(light, factor=4)
    assert cells.shape == (4, 3, 2)
    assert cells[2, 1, 0] == pytest.approx(light[2, 4:8, :4].mean())
    assert np.array_equal(coarsen(light, factor=4, sample="corner"), light[:, ::4, ::4])
    assert np.array_equal(coarsen_dark(light[0]), coarsen(light[:1])[0])
    row = np.arange(5, dtype=np.float32).reshape(1, 1, 5)
    assert coarsen(row, factor=4)[0, 0].tolist() == [1.5, 4], (
        "the border continues beyond the frame"
    )


def test_a_cell_is_factor_pixels_wide() -> None:
    assert coarsen_pixel(0.05, factor=4) == pytest.approx(0.2)
    with pytest.raises(InputError, match="give the image as `like`"):
        coarsen_pixel(0.05, factor=0)


def test_cells_of_one_pixel_change_nothing() -> None:
    light = np.random.default_rng(0).random((3, 5, 7), np.float32)
    assert np.array_equal(coarsen(light, factor=1), light)
    assert np.array_equal(enlarge_height(light[0], like(5, 7), factor=1), light[0])


@pytest.mark.parametrize(
    ("rows", "columns", "side"), [(480, 640, 4), (1080, 1920, 4), (1200, 1920, 8)]
)
def test_cells_are_twice_as_wide_above_two_megapixels(rows: int, columns: int, side: int) -> None:
    light = np.broadcast_to(np.arange(columns, dtype=np.float32), (1, rows, columns))
    cells = coarsen(light, factor=0)
    assert cells.shape == (1, rows // side, columns // side)
    assert cells[0, 0, 1] == 1.5 * side - 0.5
    assert coarsen_pixel(0.05, light, factor=0) == pytest.approx(side * 0.05)
    back = enlarge_height(cells[0], light, factor=0)
    assert np.abs(back - light[0])[:, side:-side].max() < 1e-3


def test_a_tilted_plane_is_restored_between_the_outermost_centres() -> None:
    y, x = np.mgrid[:40, :30].astype(np.float32)
    plane = 0.3 * x - 0.1 * y
    back = enlarge_height(coarsen(plane[None], factor=4)[0], like(40, 30), factor=4)
    assert np.abs(back - plane)[2:-2, 2:-4].max() < 1e-5


def test_a_ball_is_restored_within_the_sag_of_a_cell() -> None:
    radius, factor = 100.0, 4
    y, x = np.mgrid[-24:24, -32:32] + 0.5
    ball = np.sqrt(radius**2 - x**2 - y**2).astype(np.float32)
    back = enlarge_height(coarsen(ball[None], factor=factor)[0], like(48, 64), factor=factor)
    inner = (slice(factor, -factor), slice(factor, -factor))
    assert np.abs(back - ball)[inner].max() < factor**2 / radius / 2


def test_both_back_ends_agree_on_large_cells(device: OpenCL) -> None:
    """Eight columns: the kernel takes them four at a time, in two steps."""
    case = Case(
        {"K": 3, "H": 19, "W": 43, "h": 3, "w": 6},
        "random",
        "factor=8",
        {"factor": 8, "sample": "mean"},
    )
    assert compare(coarsen, case, device) is None


@pytest.mark.parametrize("sample", ["mean", "corner"])
def test_both_back_ends_agree_on_megapixels(device: OpenCL, sample: str) -> None:
    sizes = {"K": 1, "H": 1205, "W": 1923, "h": 151, "w": 241}
    settings = {"factor": 0}
    assert compare(enlarge_height, Case(sizes, "random", "default", settings), device) is None
    settings = {"factor": 0, "sample": sample}
    assert compare(coarsen, Case(sizes, "random", "default", settings), device) is None
