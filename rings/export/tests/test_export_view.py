"""A height as a camera sees it is exported with its view."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from tactograph.graph import InputError
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.write.read_height import read_height
from tests.nodes.files.test_stored_result import LENS, write

VIEWS = {"lens": View(LENS, 1 / 65), "camera": View(None, 1 / 65), "plain": View()}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", ["height.npy", "height.tiff"])
def test_an_export_has_the_mesh_of_the_run(tmp_path: Path, view: str, name: str) -> None:
    file = write(tmp_path / "run", VIEWS[view]).with_name(name)
    arguments = {"height": str(file), "out": str(tmp_path / "out"), "formats": "ply"}
    with open_pipeline("export", arguments) as pipeline:
        list(pipeline.items())
    meshes = tmp_path / "out" / "height.ply", tmp_path / "run" / "height.ply"
    exported, own = (trimesh.load(mesh, process=False).vertices for mesh in meshes)
    # A TIFF's resolution is a fraction of whole numbers.
    np.testing.assert_allclose(exported, own, rtol=0 if name == "height.npy" else 1e-6)


def test_an_exported_image_gives_a_warning_and_keeps_its_view(tmp_path: Path) -> None:
    """It warns by how much, and keeps its view for the next reader."""
    file = write(tmp_path / "run", VIEWS["lens"])
    arguments = {"height": str(file), "out": str(tmp_path / "out"), "formats": "npy,tmd,stl"}
    with open_pipeline("export", arguments) as pipeline:
        (result,) = pipeline.items()
    (warning,) = [line for line in result.warnings if "even grid" in line]
    assert warning.startswith("height.npy, height.tmd: ")
    for name in "height.npy", "height.tmd":
        with pytest.raises(InputError, match=r"save\.grid=metric"):
            read_height(file=tmp_path / "out" / name)
