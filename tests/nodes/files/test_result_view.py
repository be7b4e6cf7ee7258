"""A height as a camera sees it carries its view: readers apply it, or say no."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tactograph.graph import InputError, Provenance
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.files.result_view import read_view
from tactograph.nodes.stream.touch import View
from tactograph.nodes.write.read_height import read_height
from tactograph.nodes.write.write_result import write_result
from tests.nodes.touches import touch_of

SHAPE = (24, 32)
LENS = np.array([-0.03, 0.01, 0.02, -0.01, 0, 0.01, 0.02, 0.01], np.float32)
MADE = Provenance({}, None, [], {}, {}, [], [])
VIEWS = {"lens": View(LENS, 1 / 65), "camera": View(None, 1 / 65), "plain": View()}


def dome() -> F4:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray(2 * np.exp(-((x - 20) ** 2 + (y - 9) ** 2) / 30), np.float32)


def write(folder: Path, view: View, grid: str = "pixel") -> Path:
    image = np.ones((4, *SHAPE), np.float32)
    touch = touch_of(height=dome(), image=image, pixel=0.07, view=view)
    made = {"ply": True, "pictures": False, "provenance": MADE}
    write_result(touch, folder=folder, grid=grid, **made)  # type: ignore[arg-type]
    return folder / "height.npy"


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", ["height.npy", "height.tiff"])
def test_an_export_has_the_mesh_of_the_run(tmp_path: Path, view: str, name: str) -> None:
    file = write(tmp_path / "run", VIEWS[view]).with_name(name)
    given = {"height": str(file), "out": str(tmp_path / "out"), "formats": "ply"}
    with open_pipeline("export", given) as pipeline:
        list(pipeline.items())
    meshes = tmp_path / "out" / "height.ply", tmp_path / "run" / "height.ply"
    exported, own = (trimesh.load(mesh, process=False).vertices for mesh in meshes)
    # A TIFF's resolution is a fraction of whole numbers.
    np.testing.assert_allclose(exported, own, rtol=0 if name == "height.npy" else 1e-6)


def test_an_exported_image_says_that_it_is_as_seen(tmp_path: Path) -> None:
    """It warns by how much, and keeps its view for the next reader."""
    file = write(tmp_path / "run", VIEWS["lens"])
    given = {"height": str(file), "out": str(tmp_path / "out"), "formats": "npy,tmd,stl"}
    with open_pipeline("export", given) as pipeline:
        (result,) = pipeline.items()
    (told,) = [line for line in result.warnings if "even grid" in line]
    assert told.startswith("height.npy, height.tmd: ")
    for name in "height.npy", "height.tmd":
        with pytest.raises(InputError, match=r"save\.grid=metric"):
            read_height(file=tmp_path / "out" / name)


def test_a_height_as_a_camera_sees_it_is_refused_where_places_count(tmp_path: Path) -> None:
    file = write(tmp_path / "seen", VIEWS["lens"])
    with pytest.raises(InputError, match=r"save\.grid=metric"):
        read_height(file=file, unknown=True)
    assert read_height(file=write(tmp_path / "plain", View())).shape == SHAPE
    on_grid = write(tmp_path / "grid", VIEWS["lens"], "metric")
    assert read_height(file=on_grid, unknown=True).shape == SHAPE


@pytest.mark.parametrize("lens", [[0.0], ["a"] * 8, None])
def test_a_view_that_is_none_is_refused(tmp_path: Path, lens: object) -> None:
    file = write(tmp_path, VIEWS["lens"])
    result = tmp_path / "result.json"
    result.write_text(json.dumps({**json.loads(result.read_text()), "lens": lens}))
    with pytest.raises(InputError, match="states no view"):
        read_view(file)
