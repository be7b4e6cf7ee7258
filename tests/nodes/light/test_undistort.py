"""Images on an even grid, and results brought back to the pixels of the camera."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.files.flat_graph import split_reference
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.nodes import F4
from tactograph.nodes.error.distort_error import distort_error
from tactograph.nodes.height.distort_height import distort_height
from tactograph.nodes.light.undistort import undistort
from tactograph.nodes.light.undistort_dark import undistort_dark
from tactograph.nodes.optics.lens import camera_offset, half_diagonal, ideal_offset, ideal_places
from tactograph.nodes.shadow.distort_confidence import distort_confidence
from tactograph.nodes.shadow.distort_labels import distort_labels
from tests.each import each

ROWS, COLUMNS = 120, 160
NONE = np.zeros(8, np.float32)
PINCUSHION = np.float32([0.03, 0.004, 0, 0, 0, 0, 0, 0])
ASKEW = np.float32([-0.04, 0.01, 0.05, -0.03, 0.01, -0.006, 0.02, -0.03])
LENSES = pytest.mark.parametrize("lens", [PINCUSHION, ASKEW], ids=["pincushion", "askew"])


def surface(x: F4, y: F4) -> F4:
    """A smooth height over places in px from the middle."""
    return np.float32(np.exp(-(x**2 + (y - 10) ** 2) / 900) + 0.3 * np.sin(x / 25 + y / 30))


def places(shape: tuple[int, int] = (ROWS, COLUMNS)) -> tuple[F4, F4]:
    row, column = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    return column - (shape[1] - 1) / 2, row - (shape[0] - 1) / 2


def inner(plane: F4, margin: int = 12) -> F4:
    return plane[..., margin:-margin, margin:-margin]


@pytest.mark.parametrize("values", [np.random.default_rng(0).random((4, 9, 21), np.float32)])
def test_no_lens_returns_everything_to_the_bit(values: F4, device: OpenCL) -> None:
    labels = np.uint8(255 * values[0])
    assert np.array_equal(undistort(values, NONE), values)
    assert np.array_equal(undistort_dark(values[0], NONE), values[0])
    assert np.array_equal(distort_height(values[1], NONE), values[1])
    assert np.array_equal(distort_labels(labels, NONE), labels)
    assert np.array_equal(distort_confidence(values[2], NONE), values[2])
    assert np.array_equal(distort_error(values[3], NONE), values[3])
    on_device = device.prepare(undistort, {}, {"K": 4, "H": 9, "W": 21})
    given = {"image": device.upload(values), "lens": device.upload(NONE)}
    found, _ = on_device.launch(given)
    assert np.array_equal(device.download(found["undistort"]), values)


@LENSES
def test_an_image_is_as_a_camera_without_lens_saw_it(lens: F4) -> None:
    x, y = places()
    u, v = ideal_places(lens, (ROWS, COLUMNS))
    seen = surface(u - (COLUMNS - 1) / 2, v - (ROWS - 1) / 2)
    error = undistort(seen[None], lens)[0] - surface(x, y)
    assert np.abs(inner(error)).max() < 1e-4


@LENSES
def test_a_height_is_what_each_pixel_sees(lens: F4) -> None:
    u, v = ideal_places(lens, (ROWS, COLUMNS))
    want = surface(u - (COLUMNS - 1) / 2, v - (ROWS - 1) / 2)
    assert np.abs(inner(distort_height(surface(*places()), lens) - want)).max() < 1e-4


@LENSES
def test_distortion_and_correction_cancel(lens: F4) -> None:
    height = surface(*places())
    back = distort_height(undistort(height[None], lens)[0], lens)
    assert np.abs(inner(back - height)).max() < 2e-4


def test_a_quadratic_surface_comes_back_unchanged() -> None:
    """Cubic convolution is exact there; linear interpolation would err by an eighth of a px^2."""
    x, _ = places()
    shift = np.float32([0, 0, 0, 0, 0.02, 0, 0, 0])
    found = undistort((x * x / 100)[None], shift)[0]
    assert np.abs(inner(found - (1.02 * x) ** 2 / 100)).max() < 1e-3


def test_beyond_the_frame_its_border_is_repeated() -> None:
    x, _ = places()
    found = undistort(x[None], PINCUSHION)[0]
    assert found[0, 0] == x[0, 0]
    assert found[-1, -1] == x[-1, -1]


@LENSES
def test_labels_come_from_the_nearest_pixel(lens: F4) -> None:
    column = np.tile(np.arange(COLUMNS, dtype=np.uint8), (ROWS, 1))
    u, _ = ideal_places(lens, (ROWS, COLUMNS))
    want = np.clip(u, 0, COLUMNS - 1)
    assert np.abs(distort_labels(column, lens) - want).max() <= 0.5
    assert np.abs(distort_confidence(np.float32(column), lens) - want).max() <= 0.5


@LENSES
def test_a_linear_standard_deviation_comes_back_unchanged(lens: F4) -> None:
    x, y = places()
    u, v = ideal_places(lens, (ROWS, COLUMNS))
    want = 3 + 0.01 * (u - (COLUMNS - 1) / 2) + 0.02 * (v - (ROWS - 1) / 2)
    found = distort_error(np.float32(3 + 0.01 * x + 0.02 * y), lens)
    assert np.abs(inner(found - want)).max() < 1e-5


@LENSES
def test_no_standard_deviation_is_negative_and_no_confidence_leaves_0_to_1(lens: F4) -> None:
    """Beside a step cubic convolution overshoots, on both sides."""
    x, y = places()
    step = np.float32((x > 7) & (y < 11))
    for found in (distort_error(step, lens), distort_confidence(step, lens)):
        assert (found.min(), found.max()) == (0, 1)
    assert distort_height(step, lens).min() < 0


@each("name", shipped_names())
def test_no_graph_interpolates_an_error_or_a_confidence_as_a_height(name: str) -> None:
    """Heights alone may be below zero."""
    nodes = read_graph(name).nodes
    for entry in nodes.values():
        if entry.op == "distort_height":
            maker, port = split_reference(entry.inputs["height"], nodes)
            made = find_node(nodes[maker].op)
            assert made.outputs[port or made.name].port.low < 0, entry.inputs


@settings(max_examples=50)
@given(
    bend=st.tuples(*[st.floats(-0.06, 0.06)] * 2),
    centre=st.tuples(*[st.floats(-0.1, 0.1)] * 2),
    tilt=st.tuples(*[st.floats(-0.05, 0.05)] * 4),
)
def test_the_two_directions_of_a_lens_are_inverse(bend, centre, tilt) -> None:
    """Where it bends by at most 12 % at a corner; at 20 % a lens is about to fold the image."""
    lens = (*bend, *centre, *tilt)
    v, u = np.mgrid[-0.6:0.6:7j, -0.8:0.8:9j]
    du, dv = camera_offset(lens, u, v)
    back = ideal_offset(lens, u + du, v + dv)
    assert np.abs(np.array(back) + np.array([du, dv])).max() < 1e-4


def test_a_corner_is_one_half_diagonal_away() -> None:
    assert half_diagonal((240, 320)) == 200
    du, dv = camera_offset((0.02, 0.01, 0, 0, 0, 0, 0, 0), np.array(0.8), np.array(0.6))
    assert np.hypot(du, dv) == pytest.approx(0.03)
