"""The pixel size comes with a height: from its file, or from its result."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import TIFF_TEXT, write_tiff
from tactograph.nodes.files.stored_result import StoredResult
from tactograph.rings.export.formats import tmd
from tactograph.rings.export.nodes.export_height import export_height
from tactograph.rings.export.nodes.read_pixel_size import read_pixel_size

PIXEL = 0.05


def ramp() -> F4:
    y, x = np.mgrid[:24, :32]
    return np.asarray(0.01 * x + 0.02 * y, np.float32)


def stored(folder: Path, suffix: str, result: object = None) -> Path:
    """A height map of 0.05 mm per px, beside a ``result.json`` if one is given."""
    file = folder / f"height.{suffix}"
    export_height(ramp(), PIXEL, folder=folder, formats=(suffix,))
    if result is not None:
        (folder / "result.json").write_text(json.dumps(result))
    return file


@pytest.mark.parametrize("suffix", ["tiff", "png", "tmd"])
def test_a_format_with_a_pixel_size_needs_no_other_source(tmp_path: Path, suffix: str) -> None:
    file = stored(tmp_path, suffix, {"pixel_size_mm": 0.07})
    assert read_pixel_size(height=file) == pytest.approx(PIXEL)


def test_the_result_file_next_to_an_npy_states_it(tmp_path: Path) -> None:
    assert read_pixel_size(height=stored(tmp_path, "npy", {"pixel_size_mm": 0.07})) == 0.07


@pytest.mark.parametrize(
    "result",
    [
        None,
        {},
        [],
        {"pixel_size_mm": "0.1"},
        {"pixel_size_mm": 0},
        {"pixel_size_mm": -1},
        {"pixel_size_mm": True},
        {"pixel_size_mm": 71.4},  # um
        {"pixel_size_mm": int("9" * 330)},
    ],
)
def test_without_any_source_one_line_says_what_to_give(tmp_path: Path, result: object) -> None:
    with pytest.raises(InputError, match=r"height\.npy: states no .*; give `mm`=") as caught:
        read_pixel_size(height=stored(tmp_path, "npy", result))
    assert "\n" not in str(caught.value)


def test_a_result_that_is_cut_off_states_nothing(tmp_path: Path) -> None:
    file = stored(tmp_path, "npy")
    (tmp_path / "result.json").write_text('{"pixel_size_mm": 0.')
    with pytest.raises(InputError, match="give `mm`="):
        read_pixel_size(height=file)
    assert read_pixel_size(height=file, mm=0.1) == 0.1


@pytest.mark.parametrize(
    ("suffix", "mm", "warned"),
    [
        ("tiff", 0.06, "height.tiff: says 0.05"),
        ("npy", 0.06, "result.json: says 0.05"),
        ("tiff", 0.0501, ""),
        ("npy", 0.05, ""),
    ],
)
def test_the_users_size_wins_and_a_contradiction_is_reported(
    tmp_path: Path, suffix: str, mm: float, warned: str
) -> None:
    with collect_warnings([]) as notes:
        found = read_pixel_size(height=stored(tmp_path, suffix, {"pixel_size_mm": PIXEL}), mm=mm)
    assert found == mm
    assert bool(notes) == bool(warned)
    assert all(warned in note for note in notes)


@pytest.mark.parametrize(
    ("text", "unit"), [("a scan", 3), (TIFF_TEXT, 2)], ids=["another program's", "per inch"]
)
def test_a_printers_resolution_does_not_count_as_pixel_size(
    tmp_path: Path, text: str, unit: int
) -> None:
    file = tmp_path / "height.tiff"
    tags = {270: text, 282: 72.0, 283: 72.0, 296: unit}
    Image.fromarray(ramp()).save(file, tiffinfo=tags)
    with pytest.raises(InputError, match="states no pixel size"):
        read_pixel_size(height=file)


def test_pixels_that_are_not_square_have_no_side(tmp_path: Path) -> None:
    file = stored(tmp_path, "tmd")
    assert tmd.read(file).pixel == pytest.approx(PIXEL)
    content = file.read_bytes()
    sizes = tmd.TMD_SIZES.pack(32, 24, 32 * PIXEL, 48 * PIXEL, 0, 0)
    begin = content.index(tmd.TMD_SIZES.pack(32, 24, 32 * PIXEL, 24 * PIXEL, 0, 0))
    file.write_bytes(content[:begin] + sizes + content[begin + len(sizes) :])
    assert tmd.read(file).pixel is None


def test_a_result_whose_pixels_are_not_square_states_no_side(tmp_path: Path) -> None:
    sides = {"pixel_size_mm": 0.1, "pixel_sides_mm": [0.1, 0.1081]}
    for suffix in ("npy", "tiff"):
        folder = tmp_path / suffix
        folder.mkdir()
        file = folder / f"height.{suffix}"
        if suffix == "npy":
            np.save(file, ramp())
        else:
            write_tiff(file, ramp(), 0.1, 0.1081)
        (folder / "result.json").write_text(json.dumps(sides))
        with pytest.raises(InputError, match=r"0\.1 x 0\.1081 mm.*grid 'metric'"):
            read_pixel_size(height=file)


def test_a_height_of_another_write_than_its_result_has_no_pixel_size(tmp_path: Path) -> None:
    with StoredResult.new_files(tmp_path, {"pixel_size_mm": PIXEL}) as target:
        np.save(target / "height.npy", ramp())
    file = tmp_path / "height.npy"
    assert read_pixel_size(height=file) == PIXEL
    np.save(file, 2 * ramp())
    with pytest.raises(InputError, match=r"height.*: is not what result\.json .* was written"):
        read_pixel_size(height=file)
