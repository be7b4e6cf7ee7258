"""Exports say the same heights, in mm, to whoever reads them with the format's own library."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image, PngImagePlugin

from tactograph.graph import InputError
from tactograph.graph.command import run_command
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.files.height_files import HeightFile
from tactograph.nodes.optics.camera_view import MESH_AXES
from tactograph.nodes.write.read_height import read_height
from tactograph.rings.export.formats import tmd
from tactograph.rings.export.formats.png import PNG_TEXT
from tactograph.rings.export.nodes.export_height import MESH_FORMATS, export_height
from tests.fixtures import Calibration
from tests.pipelines.conftest import run

HEIGHT_FORMATS = ("npy", "tiff", "png", "tmd")

PIXEL = 0.05


def slope() -> F4:
    """A ramp with a step: nothing in it is symmetric."""
    y, x = np.mgrid[:24, :32]
    return np.asarray(0.01 * x + 0.02 * y + 0.5 * ((x > 20) & (y < 8)), np.float32)


def partly_known() -> F4:
    """The ramp, of which one corner was not seen."""
    height = slope()
    height[:3, :5] = np.nan
    return height


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    export_height(slope(), PIXEL, folder=tmp_path, formats=(*HEIGHT_FORMATS, *MESH_FORMATS))
    return tmp_path


@pytest.mark.parametrize(("suffix", "step"), [("npy", 0), ("tiff", 0), ("tmd", 0), ("png", 5e-5)])
def test_a_written_height_is_read_back(exported: Path, suffix: str, step: float) -> None:
    read = read_height(file=exported / f"height.{suffix}")
    assert read.dtype == np.float32
    np.testing.assert_allclose(read, slope(), rtol=0, atol=1.01 * step)


def test_a_tiff_is_in_mm_and_knows_its_pixel(exported: Path) -> None:
    np.testing.assert_array_equal(cv2.imread(str(exported / "height.tiff"), -1), slope())
    with Image.open(exported / "height.tiff") as image:
        assert image.tag_v2[296] == 3  # type: ignore[attr-defined]
        per_cm = float(image.tag_v2[282])  # type: ignore[attr-defined]
    assert 10 / per_cm == pytest.approx(PIXEL)


def test_a_png_states_its_scale(exported: Path) -> None:
    levels = cv2.imread(str(exported / "height.png"), -1)
    assert levels.dtype == np.uint16
    with Image.open(exported / "height.png") as image:
        about = json.loads(image.info[PNG_TEXT])
    assert about["unit"] == "mm"
    np.testing.assert_allclose(about["offset"] + about["step"] * levels, slope(), atol=5.1e-5)


def test_a_tmd_is_read_by_a_surface_metrology_package(exported: Path) -> None:
    from surfalize import Surface  # seconds, for each worker that collects this file

    surface = Surface.load(str(exported / "height.tmd"))
    # It takes the numbers as they stand; that they are mm is what GelSight's own files say.
    np.testing.assert_array_equal(surface.data, slope())
    assert surface.step_x == pytest.approx(PIXEL)
    assert surface.step_y == pytest.approx(PIXEL)


@pytest.mark.parametrize("suffix", ["npy", "tiff", "png"])
def test_unknown_film_stays_unknown(tmp_path: Path, suffix: str) -> None:
    export_height(partly_known(), PIXEL, folder=tmp_path, formats=(suffix,))
    file = tmp_path / f"height.{suffix}"
    np.testing.assert_allclose(read_height(file=file, unknown=True), partly_known(), atol=5.1e-5)
    with pytest.raises(InputError, match="every height must be known"):
        read_height(file=file)


@pytest.mark.parametrize("suffix", ["ply", "stl", "obj"])
def test_a_mesh_leaves_unknown_film_out(tmp_path: Path, suffix: str) -> None:
    export_height(partly_known(), PIXEL, folder=tmp_path, formats=(suffix,))
    mesh = trimesh.load_mesh(tmp_path / f"height.{suffix}")
    assert len(mesh.faces) == 2 * (23 * 31 - 3 * 5) + 1  # a triangle across the corner
    assert np.isfinite(mesh.vertices).all()


def test_a_png_shows_unknown_film_as_transparent(tmp_path: Path) -> None:
    export_height(partly_known(), PIXEL, folder=tmp_path, formats=("png",))
    with Image.open(tmp_path / "height.png") as image:
        clear = np.asarray(image) == image.info["transparency"]
    np.testing.assert_array_equal(clear, np.isnan(partly_known()))
    whole = slope() - slope().min() - 0.9
    export_height(whole, PIXEL, folder=tmp_path, formats=("png",))
    with Image.open(tmp_path / "height.png") as image:
        assert "transparency" not in image.info
    np.testing.assert_allclose(read_height(file=tmp_path / "height.png"), whole, atol=5.1e-5)


def test_heights_that_a_png_cannot_hold_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    lowest = partly_known() - np.nanmin(partly_known()) - 1  # the level of unknown film
    for height in (lowest, slope() + 10):
        with pytest.raises(InputError, match="do not fit"):
            export_height(height, PIXEL, folder=tmp_path, formats=("npy", "png"))
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_called_like_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is to be a folder; `formats`=ply writes height\.ply"):
        export_height(slope(), PIXEL, folder=tmp_path / "cat.ply")
    with pytest.raises(InputError, match=r"no format is called xyz; `formats` .* npy, .*Make"):
        export_height(slope(), PIXEL, folder=tmp_path / "cat.xyz")
    assert not any(tmp_path.iterdir())
    (tmp_path / "cat.xyz").mkdir()
    for name in ("cat.xyz", "2026.11.30", "bench.v2", "a.Left"):
        export_height(slope(), PIXEL, folder=tmp_path / name, formats=("npy",))


def test_a_tmd_cannot_hold_unknown_film_and_says_which_format_can(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"height\.tmd: .* at 15 pixels, .*; write tiff") as caught:
        export_height(partly_known(), PIXEL, folder=tmp_path, formats=("npy", "tmd"))
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", ["npy", "tiff"])
@pytest.mark.parametrize(
    ("wrong", "message"), [(np.inf, "infinite values"), (np.nan, "no height, only NaN")]
)
def test_infinite_heights_and_nothing_known_are_refused(
    tmp_path: Path, suffix: str, wrong: float, message: str
) -> None:
    height = np.full((6, 7), wrong, np.float32)
    export_height(height, PIXEL, folder=tmp_path, formats=(suffix,))
    with pytest.raises(InputError, match=message):
        read_height(file=tmp_path / f"height.{suffix}", unknown=True)


def test_a_height_unknown_in_parts_is_exported(tmp_path: Path) -> None:
    np.save(tmp_path / "height.npy", partly_known())
    given = {"height": tmp_path / "height.npy", "pixel_size_mm": PIXEL}
    list(open_pipeline("export", {**given, "out": tmp_path / "out", "formats": "stl,png"}).items())
    assert sorted(file.suffix for file in (tmp_path / "out").iterdir()) == [".png", ".stl"]


def test_gelsights_own_file_is_read_in_mm(groove: Path) -> None:
    expected = np.load(groove / "heightmap_mm.npy")
    np.testing.assert_allclose(read_height(file=groove / "heightmap.tmd"), expected, atol=1e-6)


@pytest.mark.parametrize("suffix", ["ply", "stl", "obj"])
def test_a_mesh_is_in_mm_from_the_middle_faces_the_camera_and_is_not_mirrored(
    exported: Path, suffix: str
) -> None:
    """It counts as contacts and pictures do, and says so."""
    file = exported / f"height.{suffix}"
    mesh, corner = trimesh.load_mesh(file), np.array([31, 23]) * PIXEL / 2
    assert mesh.bounds[:, :2] == pytest.approx(np.array([-corner, corner]), abs=1e-6)
    assert mesh.extents[2] == pytest.approx(float(np.ptp(slope())), rel=1e-5)
    assert (mesh.face_normals[:, 2] > 0).all()
    assert MESH_AXES.encode() in file.read_bytes()[:200]
    high = mesh.vertices[mesh.vertices[:, 2] > np.quantile(mesh.vertices[:, 2], 0.9)]
    assert (high[:, :2].mean(axis=0) > 0).all(), "to the right, and up"


def test_touches_of_a_stream_go_into_folders_of_their_names(tmp_path: Path) -> None:
    export_height(slope(), PIXEL, "touch_1", folder=tmp_path, formats=("tmd",))
    assert (tmp_path / "touch_1" / "height.tmd").is_file()


@settings(max_examples=30)
@given(
    arrays.arrays(
        np.float32,
        st.tuples(st.integers(1, 6), st.integers(1, 6)),
        elements=st.floats(-1, 5, width=32),
    )
)
def test_any_height_survives_a_tmd(tmp_path_factory: pytest.TempPathFactory, height: F4) -> None:
    file = tmp_path_factory.mktemp("tmd") / "height.tmd"
    tmd.write(file, height, PIXEL)
    np.testing.assert_array_equal(tmd.read(file).height, height)


@pytest.mark.parametrize(("suffix", "ends"), [("tmd", (0, 10, 31, 40, 60, 79, 90, -1))])
def test_a_damaged_file_is_refused_wherever_it_ends(
    exported: Path, suffix: str, ends: tuple[int, ...]
) -> None:
    whole, cut = (exported / f"height.{suffix}").read_bytes(), exported / f"cut.{suffix}"
    for end in ends:
        cut.write_bytes(whole[:end])
        with pytest.raises(InputError, match=rf"cut\.{suffix}"):
            read_height(file=cut)


NO_NUMBERS = ["9" * 330, "1e300", "Infinity", "NaN"]


def png_that_says(file: Path, **words: str) -> Path:
    """A 16-bit PNG with such words about its scale."""
    about = {"step": "1e-4", "offset": "-1", "pixel_size_mm": "0.1", **words}
    text = PngImagePlugin.PngInfo()
    text.add_text(PNG_TEXT, "{" + ", ".join(f'"{key}": {n}' for key, n in about.items()) + "}")
    Image.fromarray(np.full((4, 5), 7, np.uint16)).save(file, pnginfo=text)
    return file


@pytest.mark.parametrize("number", NO_NUMBERS)
@pytest.mark.parametrize("name", ["step", "offset"])
def test_a_scale_that_is_not_a_number_gives_no_height(
    tmp_path: Path, name: str, number: str
) -> None:
    file = png_that_says(tmp_path / "height.png", **{name: number})
    with pytest.raises(InputError, match=r"height\.png: (holds|cannot be decoded)"):
        read_height(file=file)


@pytest.mark.parametrize("number", NO_NUMBERS[1:])
def test_a_pixel_size_that_is_not_a_length_is_not_stated(tmp_path: Path, number: str) -> None:
    file = png_that_says(tmp_path / "height.png", pixel_size_mm=number)
    assert HeightFile.read(file).pixel is None


def test_a_missing_file_or_a_png_without_a_scale_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_height(file=tmp_path / "none.tmd")
    cv2.imwrite(str(tmp_path / "grey.png"), np.zeros((4, 5), np.uint16))
    with pytest.raises(InputError, match="states no scale"):
        read_height(file=tmp_path / "grey.png")


@pytest.mark.parametrize(
    ("height", "message"),
    [(np.zeros((0, 0)), "holds no pixel"), (np.full((4, 4), 1e300), "holds NaN or infinite")],
)
def test_a_height_map_of_no_pixel_or_beyond_float32_is_refused(
    tmp_path: Path, height: F4, message: str
) -> None:
    np.save(tmp_path / "height.npy", height)
    with pytest.raises(InputError, match=message):
        read_height(file=tmp_path / "height.npy")


@pytest.mark.parametrize("mm", [1e300, 1e-300, 0.0, -1.0])
def test_a_pixel_that_no_file_can_hold_is_refused(mm: float) -> None:
    with pytest.raises(InputError, match=r"^export: pixel_size_mm: input should be "):
        open_pipeline("export", {"height": "height.npy", "pixel_size_mm": mm})


def test_a_mesh_of_a_curved_film_is_the_films_own_shape(
    calibration: Calibration, tmp_path: Path
) -> None:
    """Where the calibration says how it is curved; without it a warning says what is missing."""
    with np.load(calibration("near33")) as known:
        arrays = dict(known)
    rows, columns = arrays["flat"].shape[1:]
    y, x = np.mgrid[:rows, :columns].astype(np.float32) / 14
    x, y = x - x.mean(), y.mean() - y
    rest = arrays["rest"] = (x * x + y * y).astype(np.float32) / 60
    np.savez(tmp_path / "cal.npz", **arrays)
    height = 0.1 * (x > 0).astype(np.float32)
    np.save(tmp_path / "height.npy", height)
    record = {"pixel_size_mm": 1 / 14, "metrics": {"rest_relief_mm": 1.0}}
    record |= {"lens": [0.0] * 8, "camera": 1 / 60, "files": ["height.npy"]}
    (tmp_path / "result.json").write_text(json.dumps(record))
    given = {"height": tmp_path / "height.npy", "formats": "ply"}
    laid_out = run("export", tmp_path / "flat", **given)
    assert any("meshes lay the height out on a plane" in line for line in laid_out.warnings)
    run("export", tmp_path / "round", **given, calibration=tmp_path / "cal.npz")
    found = trimesh.load_mesh(tmp_path / "round/height.ply", process=False).vertices
    film = (rest + height).astype(np.float64)
    lies = np.stack([x * (1 - film / 60), y * (1 - film / 60), film], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(found, lies, atol=2e-5)


def test_success_prints_the_range_of_the_height_and_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "height.npy", np.float32([[-0.25, 0], [0.5, 1.5]]))
    out = tmp_path / "exported"
    given = f"height={tmp_path / 'height.npy'}", "pixel_size_mm=0.1", f"out={out}"
    run_command(["run", "export", *given])
    first, *lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"1: [\d.]+ ms on numpy", first)
    assert lines == ["  height  -0.25 to 1.5 mm", f"written to {out}"]


def test_a_result_in_place_of_its_height_is_answered_with_the_height(tmp_path: Path) -> None:
    np.save(tmp_path / "height.npy", np.ones((4, 5), np.float32))
    with pytest.raises(InputError, match=r"is a folder; give .*height\.npy"):
        run_command(["run", "export", f"height={tmp_path}", f"out={tmp_path / 'out'}"])
