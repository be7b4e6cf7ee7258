"""Meshes of known form."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tactograph.graph import InputError
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.rings.shapes import mesh_file as module
from tactograph.rings.shapes.nodes.shape_mesh import shape_mesh


@pytest.fixture
def saved(tmp_path):
    def save(mesh, name="mesh.stl"):
        mesh.export(tmp_path / name)
        return tmp_path / name

    return save


def hook():
    """An L in the plane of x and y: long along x, its foot at the left end towards +y."""
    long = trimesh.creation.box(bounds=[(0, 0, 0), (8, 2, 1)])
    foot = trimesh.creation.box(bounds=[(0, 2, 0), (2, 4, 1)])
    return trimesh.util.concatenate([long, foot])


def test_ball_of_triangles_is_a_ball(saved):
    file = saved(trimesh.creation.icosphere(5, 5.0), "ball.ply")
    height = shape_mesh(file=file, rise_mm=5.0).height
    expected = shape_ball(radius_mm=5.0).height
    inner = expected > 1
    np.testing.assert_allclose(height[inner], expected[inner], atol=0.02)


def test_box_has_no_gaps(saved, monkeypatch):
    # Both triangles of a face share an edge that runs through pixel centres; small portions.
    monkeypatch.setattr(module, "PAIRS_AT_ONCE", 1000)
    file = saved(trimesh.creation.box((8.0, 6.0, 2.0)))
    height, pixel = shape_mesh(file=file, up="z", pixel_size_mm=0.1)
    assert np.count_nonzero(height) * pixel**2 == pytest.approx(48, rel=0.03)
    np.testing.assert_allclose(height[height > 0], 2, atol=1e-5)


def test_seen_from_above_a_mesh_is_not_mirrored(saved):
    height = shape_mesh(file=saved(hook()), up="z").height
    y, x = np.nonzero(height)
    # Mesh axes are right-handed, so its y points up in the image: the foot is at the top left.
    assert x[y < y.min() + 10].max() < 159.5
    assert x[y > y.max() - 10].max() > 200


def test_seen_from_below_it_is_flipped(saved):
    above, below = (shape_mesh(file=saved(hook()), up=u).height for u in ("z", "-z"))
    np.testing.assert_allclose(below, above[::-1], atol=1e-5)


def test_flat_lays_the_longest_axis_along_x_and_the_shortest_up(saved):
    file = saved(trimesh.creation.box((2.0, 9.0, 5.0)))
    height, pixel = shape_mesh(file=file)
    assert height.max() == pytest.approx(2, rel=1e-5)
    assert np.ptp(np.flatnonzero(height.any(0))) * pixel == pytest.approx(9, abs=0.2)


def test_length_scales_the_mesh(saved):
    height, pixel = shape_mesh(file=saved(trimesh.creation.box((1, 2, 4.0))), length_mm=12.0)
    assert np.ptp(np.flatnonzero(height.any(0))) * pixel == pytest.approx(12, abs=0.2)
    assert height.max() == pytest.approx(3, rel=1e-5)


def test_part_outside_the_image_is_cut_off(saved):
    file = saved(trimesh.creation.box((80.0, 60.0, 2.0)))
    height = shape_mesh(file=file, offset_mm=(40.0, 0.0)).height
    assert (height[:, 200:] > 0).all()
    assert not height[:, :120].any()


def test_a_file_that_is_not_a_mesh_is_refused(saved, tmp_path):
    points = saved(trimesh.PointCloud(np.eye(3)), "points.ply")
    for name in ("a.stl", "a.xyzzy"):
        (tmp_path / name).write_bytes(b"what is this")
    for file, message in (
        (tmp_path / "no.stl", "there is no file"),
        (tmp_path / "a.stl", "a.stl"),
        (tmp_path / "a.xyzzy", "a.xyzzy"),
        (points, "holds no triangles"),
    ):
        with pytest.raises(InputError, match=message):
            shape_mesh(file=file)


def test_without_its_package_it_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(InputError, match=r"needs trimesh: pip install 'tactograph\[mesh\]'"):
        shape_mesh(file=Path("a.stl"))
