"""The content of a result in addition to its heights."""

import json
import shutil
import threading
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph import InputError, Provenance
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.drawing.result_pictures import (
    draw_height,
    draw_labels,
    draw_map,
    draw_regions,
)
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.layers.error import ERROR_MAP
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import ColourMap, Touch
from tactograph.nodes.write.read_height import read_height
from tactograph.nodes.write.write_result import write_result
from tests.nodes.touches import touch_of

SHAPE = (8, 10)
PROVENANCE = Provenance({}, None, [], {}, {}, [], [])


def flat(**parts: Any) -> Touch:
    """A touch of a flat film, with these parts."""
    level, image = np.zeros(SHAPE, np.float32), np.ones((4, *SHAPE), np.float32)
    nothing = np.zeros(SHAPE, np.uint8)
    return touch_of(**{"height": level, "image": image, "pixel": 0.1, "shadow": nothing, **parts})


def write(
    folder: Path, count: int, shadow: int, highlight: int | None = None, **parts: Any
) -> list[str]:
    """Write a flat film's result; the warnings that came with it."""
    bits = np.full(SHAPE, shadow, np.uint8)
    mirrored = None if highlight is None else np.full(SHAPE, highlight, np.uint8)
    touch = flat(
        image=np.ones((count, *SHAPE), np.float32), shadow=bits, highlight=mirrored, **parts
    )
    with collect_warnings([]) as notes:
        write_result(touch, folder=folder, pictures=False, provenance=PROVENANCE)
    return notes


@pytest.mark.parametrize(
    ("count", "shadow", "warned"), [(3, 0, False), (3, 0b10, True), (4, 0b10, False)]
)
def test_a_shadow_under_three_leds_is_a_warning(
    tmp_path: Path, count: int, shadow: int, warned: bool
) -> None:
    notes = write(tmp_path, count, shadow)
    assert bool(notes) == warned
    assert all("two lights allow two slopes" in note for note in notes)


@pytest.mark.parametrize(("camera", "cure"), [(0.0, "'precise'"), (None, "press less steeply")])
def test_precise_is_named_only_where_it_takes_the_calibration(
    tmp_path: Path, camera: float | None, cure: str
) -> None:
    assert cure in write(tmp_path, 3, 0b10, view=View(None, camera))[0]


def test_highlights_are_written_where_the_graph_gives_them(tmp_path: Path) -> None:
    write(tmp_path / "matt", 4, 0)
    write(tmp_path / "glossy", 4, 0, highlight=0b100)
    assert not (tmp_path / "matt" / "highlight.png").exists()
    bits = cv2.imread(str(tmp_path / "glossy" / "highlight.png"), cv2.IMREAD_UNCHANGED)
    assert (bits == 0b100).all()


def test_confidence_contacts_and_unresolved_pixels_are_written(tmp_path: Path) -> None:
    """Contacts as their numbers, and unresolved pixels white."""
    sure, numbers = np.full(SHAPE, 0.75, np.float32), np.zeros(SHAPE, np.uint8)
    numbers[2:4, 3:5], unresolved = 2, np.eye(*SHAPE, dtype=np.uint8)
    touch = flat(confidence=sure, contact=numbers, unresolved=unresolved)
    write_result(touch, folder=tmp_path, provenance=PROVENANCE)
    assert np.array_equal(np.load(tmp_path / "confidence.npy"), sure)
    assert cv2.imread(str(tmp_path / "confidence.png")) is not None
    for name, plane in (("unresolved", 255 * unresolved), ("contact", numbers)):
        written = cv2.imread(str(tmp_path / f"{name}.png"), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(written, plane)


def test_numbers_that_look_black_have_a_picture_in_addition(tmp_path: Path) -> None:
    numbers = np.zeros(SHAPE, np.uint8)
    numbers[2:4, 3:5], numbers[5:7, 6:9] = 1, 2
    for name, labels in (("free", 0 * numbers), ("touched", numbers)):
        touch = flat(shadow=labels, contact=labels, highlight=labels)
        write_result(touch, folder=tmp_path / name, provenance=PROVENANCE)
    for what in ("shadow", "highlight", "contact"):
        views = [tmp_path / name / f"{what}_view.png" for name in ("free", "touched")]
        free, touched = (colours_of(cv2.imread(str(view))) for view in views)
        assert len(touched - free) >= 2, what


def result(folder: Path, pixel: float = 0.1, level: float = 0.0, **more: object) -> set[str]:
    """Write the result of a film with a dent in its corner; return the files in the folder."""
    height = np.full(SHAPE, level, np.float32)
    height[1, 8] += 1.0
    settings = {name: more.pop(name, False) for name in ("ply", "pictures")}
    touch = flat(height=height, pixel=pixel, **more)
    write_result(touch, folder=folder, provenance=PROVENANCE, **settings)
    return {file.name for file in folder.iterdir()}


def full() -> dict[str, object]:
    """All that a result may hold."""
    plane, labels = np.ones(SHAPE, np.float32), np.ones(SHAPE, np.uint8)
    maps = {"error": 0.01 * plane, "confidence": plane, "highlight": labels, "contact": labels}
    return maps | {"ply": True, "pictures": True}


def test_a_result_states_its_pixel_size_and_names_its_files_with_checksums(tmp_path: Path) -> None:
    files = result(tmp_path, **full())
    stated = json.loads((tmp_path / "result.json").read_text())
    assert stated["pixel_size_mm"] == 0.1
    assert set(stated["files"]) == files
    assert {*stated["checksums"]} == files - {"result.json"}
    height = (tmp_path / "height.npy").read_bytes()
    assert stated["checksums"]["height.npy"] == f"{zlib.crc32(height):08x}"


def test_files_of_an_earlier_result_that_this_one_lacks_are_deleted(tmp_path: Path) -> None:
    result(tmp_path / "again", **full())
    assert result(tmp_path / "again") == result(tmp_path / "new")


def test_files_that_are_not_of_an_earlier_result_stay(tmp_path: Path) -> None:
    """A mesh of another node, a file of the user, and files that a damaged result names."""
    result(tmp_path)
    for name in ("height.ply", "error.npy", "notes.txt"):
        (tmp_path / name).write_text("mine")
    (tmp_path.parent / "outside.txt").write_text("mine")
    stated = json.loads((tmp_path / "result.json").read_text())
    stated["files"] += ["notes.txt", "../outside.txt"]
    (tmp_path / "result.json").write_text(json.dumps(stated))
    assert {"height.ply", "error.npy", "notes.txt"} <= result(tmp_path)
    assert (tmp_path.parent / "outside.txt").exists()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"files": 3}'])
def test_a_result_that_names_no_files_deletes_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)
    (tmp_path / "error.npy").write_text("mine")
    assert "error.npy" in result(tmp_path)


def test_a_result_that_fails_leaves_the_earlier_one_intact(tmp_path: Path) -> None:
    files = result(tmp_path, **full())
    with pytest.raises(InputError, match="camera"):
        result(tmp_path, view=View(None, 2.0), ply=True)
    assert {file.name for file in tmp_path.iterdir()} == files


@pytest.mark.parametrize("suffix", ["npy", "tiff"])
def test_a_height_of_another_write_than_its_result_is_refused(tmp_path: Path, suffix: str) -> None:
    """A kill while files are moved leaves such a height."""
    result(tmp_path / "old")
    result(tmp_path / "new", pixel=0.2, level=0.5)
    file = tmp_path / "old" / f"height.{suffix}"
    assert read_height(file=file).max() == 1.0
    shutil.copy(tmp_path / "new" / file.name, file)
    with pytest.raises(InputError, match=r"height.*: is not what result\.json .* was written"):
        read_height(file=file)
    alone = shutil.copy(file, tmp_path / file.name)
    assert read_height(file=Path(alone)).max() == 1.5


def test_pictures_count_mm_from_the_middle_as_contacts_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, Figure] = {}

    def keep(canvas: FigureCanvasAgg, file: Path) -> None:
        drawn[file.stem] = canvas.figure
        file.touch()

    monkeypatch.setattr(FigureCanvasAgg, "print_png", keep)
    monkeypatch.setattr("tactograph.nodes.drawing.result_pictures._mine", threading.local())
    result(tmp_path, **full())
    for name in ("height", "error", "confidence"):
        borders = drawn[name].axes[0].images[0].get_extent()
        assert borders == pytest.approx((-0.5, 0.5, 0.4, -0.4)), name
    plane, section = drawn["height"].axes[:2]
    dent = (8 - 4.5) * 0.1, (1 - 3.5) * 0.1
    line = section.lines[0]
    assert line.get_xdata()[line.get_ydata().argmax()] == pytest.approx(dent[0])
    assert plane.lines[0].get_ydata() == pytest.approx([dent[1]] * 2)
    assert f"y = {dent[1]:.2f} mm" in section.get_title()


def test_shadows_of_several_leds_have_one_dark_colour_in_all_pictures(tmp_path: Path) -> None:
    shades = []
    for name, bits in (("one", 0b1), ("several", 0b11)):
        grey, file = np.ones(SHAPE, np.float32), tmp_path / f"{name}.png"
        draw_labels(np.full(SHAPE, bits, np.uint8), grey, 4, "in shadow", file)
        picture = cv2.imread(str(tmp_path / f"{name}.png"))
        shades.append(float(picture[200:300, 200:300].mean()))
    assert shades[1] < 128 < shades[0]


def colours_of(picture: np.ndarray) -> set[int]:
    """The colours of at least 2000 pixels of a picture."""
    colours, counts = np.unique(picture @ np.array([1, 256, 65536]), return_counts=True)
    return set(colours[counts >= 2000].tolist())


@pytest.mark.parametrize(("draw", "about"), [(draw_labels, (4, "title")), (draw_regions, ("rib",))])
def test_a_picture_does_not_show_the_previous_touch(
    tmp_path: Path, draw: Any, about: tuple[Any, ...]
) -> None:
    grey, one, other = np.ones(SHAPE, np.float32), np.zeros(SHAPE, np.uint8), np.eye(8, 10)
    for name, numbers in (("first", one), ("between", other.astype(np.uint8)), ("again", one)):
        draw(numbers, grey, *about, tmp_path / f"{name}.png")
    first, between, repeated = (
        (tmp_path / f"{n}.png").read_bytes() for n in ("first", "between", "again")
    )
    assert first == repeated != between


def test_an_equal_height_is_drawn_once_and_another_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run of `compare` over a late value differs from the one before in few layers."""
    drawn: list[float] = []
    monkeypatch.setattr("tactograph.nodes.drawing.result_pictures._mine", threading.local())

    def draw(height: np.ndarray, error: object, pixel: float, file: Path) -> None:
        drawn.append(float(height[0, 0]))
        file.write_bytes(bytes([len(drawn)]))

    monkeypatch.setattr("tactograph.nodes.drawing.result_pictures.draw_height", draw)
    for name, level, pixel in (("a", 0, 0.1), ("b", 0, 0.1), ("c", 1, 0.1), ("d", 1, 0.2)):
        touch = flat(height=np.full(SHAPE, level, np.float32), pixel=pixel)
        write_result(touch, folder=tmp_path / name, provenance=PROVENANCE)
    assert drawn == [0, 1, 1]
    pictures = [(tmp_path / name / "height.png").read_bytes() for name in "abcd"]
    assert pictures == [b"\1", b"\1", b"\2", b"\3"]


def test_an_outlier_in_a_corner_does_not_widen_the_colours_and_the_range_is_stated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []
    monkeypatch.setattr(Axes, "set_title", lambda _, text: titles.append(text))
    height = np.maximum(0, 1 - np.hypot(*np.mgrid[-30:30, -40:40]) / 20).astype(np.float32)
    draw_height(height, None, 0.1, tmp_path / "plain.png")
    height[0, :2] = 40
    draw_height(height, None, 0.1, tmp_path / "corner.png")
    assert titles[0] == "height, 0 to 1 mm"
    assert titles[2] == "height, 0 to 40 mm"
    assert titles[3].endswith("0.05 mm"), "the section is not drawn through the corner"


def test_an_error_that_spans_decades_is_drawn_by_its_logarithm(tmp_path: Path) -> None:
    spans = (1e-3 * 10 ** np.linspace(0, 3, 200)).reshape(10, 20).astype(np.float32)
    for name, plane in (("spans", spans), ("none", 0 * spans), ("unknown", np.nan * spans)):
        draw_map(plane, ERROR_MAP, 0.1, tmp_path / f"{name}.png")
    draw_map(spans, ColourMap("", "", "magma"), 0.1, tmp_path / "linear.png")
    log, linear = (ImageFile(tmp_path / f"{name}.png").read() for name in ("spans", "linear"))
    assert log[150:250].mean() > linear[150:250].mean() + 10
