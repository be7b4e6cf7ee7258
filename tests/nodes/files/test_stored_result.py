"""A height as a camera sees it carries its view: readers apply it, or refuse it."""

import json
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError, Provenance
from tactograph.nodes import F4
from tactograph.nodes.files.stored_result import StoredResult
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.write.read_height import read_height
from tactograph.nodes.write.write_result import write_result
from tests.nodes.touches import touch_of

SHAPE = (24, 32)
LENS = np.array([-0.03, 0.01, 0.02, -0.01, 0, 0.01, 0.02, 0.01], np.float32)
PROVENANCE = Provenance({}, None, [], {}, {}, [], [])
VIEW = View(LENS, 1 / 65)


def dome() -> F4:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray(2 * np.exp(-((x - 20) ** 2 + (y - 9) ** 2) / 30), np.float32)


def write(folder: Path, view: View, grid: str = "pixel") -> Path:
    image = np.ones((4, *SHAPE), np.float32)
    touch = touch_of(height=dome(), image=image, pixel=0.07, view=view)
    options = {"ply": True, "pictures": False, "provenance": PROVENANCE}
    write_result(touch, folder=folder, grid=grid, **options)  # type: ignore[arg-type]
    return folder / "height.npy"


def test_a_height_as_a_camera_sees_it_is_refused_where_places_matter(tmp_path: Path) -> None:
    file = write(tmp_path / "seen", VIEW)
    with pytest.raises(InputError, match=r"save\.grid=metric"):
        read_height(file=file, unknown=True)
    assert read_height(file=write(tmp_path / "plain", View())).shape == SHAPE
    on_grid = write(tmp_path / "grid", VIEW, "metric")
    assert read_height(file=on_grid, unknown=True).shape == SHAPE


@pytest.mark.parametrize("lens", [[0.0], ["a"] * 8, None])
def test_an_invalid_view_is_refused(tmp_path: Path, lens: object) -> None:
    file = write(tmp_path, VIEW)
    result = tmp_path / "result.json"
    result.write_text(json.dumps({**json.loads(result.read_text()), "lens": lens}))
    with pytest.raises(InputError, match="view is damaged"):
        StoredResult.beside(file).view(file)
