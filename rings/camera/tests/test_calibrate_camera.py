"""A camera is found from one image of a grid on the film."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rings.camera.tests.grids import SUB, board, dots, on_film, pixels
from tactograph.graph import InputError, Provenance
from tactograph.graph.command import run_command
from tactograph.graph.declare.check_settings import check_settings
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.undistort_presses import undistort_presses
from tactograph.nodes.calibrate.camera.pixel_size import pixel_size
from tactograph.nodes.calibrate.file.read_lens import read_lens
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.light.undistort import undistort
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.optics.lens import half_diagonal, ideal_places
from tactograph.rings.camera.nodes.find_grid import GridMarks, find_grid
from tactograph.rings.camera.nodes.fit_lens import LensFit, fit_lens
from tactograph.rings.camera.nodes.read_grey import read_grey
from tactograph.rings.camera.nodes.write_camera import write_camera
from tests.fixtures import python

SHAPE, ROUND_SHAPE = (240, 320), (480, 640)
NONE = np.zeros(8, np.float32)
MADE = Provenance({}, None, [], {}, {}, [], [])
PITCH_MM = 1.5


def camera_of(image: F4, pattern: str = "auto") -> LensFit:
    return fit_lens(image, find_grid(image, pattern=pattern), pitch_mm=PITCH_MM)


def largest_departure(found: F4, true: F4) -> float:
    """By how much two lenses differ anywhere in the image, in px."""
    there, here = ideal_places(found, SHAPE), ideal_places(true, SHAPE)
    return float(np.hypot(there[0] - here[0], there[1] - here[1]).max())


@settings(max_examples=8)
@given(
    k1=st.floats(-0.08, 0.06),
    pitch=st.floats(15, 40),
    turn=st.floats(-0.7, 0.7),
    bright=st.booleans(),
    shift=st.tuples(*[st.floats(-0.5, 0.5)] * 2),
)
@pytest.mark.slow
def test_a_bent_dot_grid_tells_the_lens(k1, pitch, turn, bright, shift) -> None:
    lens = np.float32([k1, 0, 0, 0, 0, 0, 0, 0])
    image = pixels(dots(*on_film(SHAPE, lens, pitch, turn, shift), bright=bright))
    found = camera_of(image)
    assert found.residual < 0.05
    assert found.pixel == pytest.approx(PITCH_MM / pitch, rel=1e-3)
    assert largest_departure(found.lens, lens) < 0.3


@pytest.mark.parametrize("pitch", [14.0, 31.0])
def test_a_bent_checkerboard_tells_the_lens(pitch: float) -> None:
    lens = np.float32([0.03, 0, 0, 0, 0, 0, 0, 0])
    image = pixels(board(*on_film(SHAPE, lens, pitch, 0.2, (0.1, 0.3))))
    assert find_grid(image).pattern == "checkerboard"
    found = camera_of(image)
    assert found.residual < 0.1
    assert found.pixel == pytest.approx(PITCH_MM / pitch, rel=1e-3)
    assert largest_departure(found.lens, lens) < 0.3


def test_a_tilted_camera_is_reported_in_degrees() -> None:
    """The film's far side is 2 % smaller than its near side, as at 40 mm and 2.8 degrees."""
    lens = np.float32([0.02, 0, 0, 0, 0, 0, 0.02, 0])
    image = pixels(dots(*on_film(SHAPE, lens, 20, 0.1, (0, 0))))
    marks = find_grid(image)
    found = fit_lens(image, marks, pitch_mm=PITCH_MM, camera_mm=40)
    assert largest_departure(found.lens, lens) < 0.3
    sine = 0.02 * 40 / (float(half_diagonal(SHAPE)) * PITCH_MM / 20)
    assert found.quality["tilt_deg"] == pytest.approx(np.degrees(np.arcsin(sine)), rel=0.1)


def test_a_grid_without_distortion_gives_no_lens() -> None:
    image = pixels(dots(*on_film(SHAPE, NONE, 20, 0.05, (0, 0))))
    assert not camera_of(image).lens.any()


def test_dots_that_the_frame_cuts_are_left_out() -> None:
    marks = find_grid(pixels(dots(*on_film(SHAPE, NONE, 20, 0, (0, 0)))))
    radius = 0.23 * 20
    assert marks.place.min() > radius
    assert (marks.place.max(axis=0) < np.array(SHAPE[::-1]) - radius).all()


def test_part_of_a_grid_with_holes_and_dirt_is_enough() -> None:
    i, j = on_film(SHAPE, NONE, 20, 0.1, (0, 0))
    near = np.hypot(np.rint(i) - 1, np.rint(j) + 1) < 5
    lost = (np.rint(i) == 2) & (np.rint(j) == 1)
    dirt = np.hypot(i - 5.4, j - 3.6) < 0.15
    image = pixels(np.where(dirt, 0.15, np.where(near & ~lost, dots(i, j), 0.8)))
    with collect_warnings([]) as notes:
        found = camera_of(image)
    assert found.pixel == pytest.approx(PITCH_MM / 20, rel=1e-3)
    assert any("of the way to the corners" in note for note in notes)
    assert found.quality["unused_marks"] == 1, "the lost one; dirt is no dot"


def test_a_large_image_is_measured_in_full() -> None:
    lens = np.float32([-0.02, 0, 0, 0, 0, 0, 0, 0])
    small = pixels(dots(*on_film(SHAPE, lens, 20, 0.1, (0, 0))), noise=0)
    image = cv2.resize(small, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC)
    found = camera_of(image)
    assert found.pixel == pytest.approx(PITCH_MM / 100, rel=1e-3)
    assert found.residual < 0.3
    assert found.lens[0] + found.lens[1] == pytest.approx(-0.02, abs=2e-3)


def test_a_mark_that_is_off_is_left_out() -> None:
    image = pixels(dots(*on_film(SHAPE, NONE, 20, 0.1, (0, 0))))
    marks = find_grid(image)
    place = marks.place.copy()
    place[7] += 1.5
    found = fit_lens(image, marks._replace(place=place), pitch_mm=PITCH_MM)
    assert np.isnan(found.departure[7]).all()
    assert found.quality["unused_marks"] == 1


@pytest.mark.parametrize("pattern", ["auto", "dots", "checkerboard"])
def test_an_image_without_a_grid_is_refused(pattern: str) -> None:
    noise = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    for image in (noise, np.full(SHAPE, 0.5, np.float32), np.zeros(SHAPE, np.float32)):
        with pytest.raises(InputError, match=r"shows no square lattice of 12 .* `pattern`"):
            find_grid(image, pattern=pattern)


def test_too_few_dots_are_refused() -> None:
    image = pixels(dots(*on_film(SHAPE, NONE, 110, 0, (0.5, 0.5))))
    with pytest.raises(InputError, match="show more of the grid"):
        find_grid(image)


def test_the_wrong_pattern_is_refused() -> None:
    dotted = pixels(dots(*on_film(SHAPE, NONE, 20, 0.1, (0, 0))))
    squares = pixels(board(*on_film(SHAPE, NONE, 20, 0.1, (0, 0))))
    for image, pattern in ((dotted, "checkerboard"), (squares, "dots")):
        with pytest.raises(InputError, match="name another `pattern`"):
            find_grid(image, pattern=pattern)


def test_marks_on_no_even_grid_are_refused() -> None:
    cell = np.int32(np.argwhere(np.ones((6, 8))))
    place = 30 * cell + np.random.default_rng(0).normal(0, 5, cell.shape)
    marks = GridMarks(np.float32(place + 20), cell, "dots", 0)
    with pytest.raises(InputError, match="lay it flat on the film"):
        fit_lens(np.zeros(SHAPE, np.float32), marks, pitch_mm=1.0)


def test_a_lens_beyond_the_model_is_distinguished_from_a_bent_grid() -> None:
    """A fisheye of 140 degrees, whose radius grows with the angle."""
    cell = np.int32(np.argwhere(np.ones((61, 61))) - 30)
    far = 0.1 * np.hypot(*cell.T)
    seen = 150 * cell * (0.1 * np.arctan(far) / np.maximum(far, 1e-9))[:, None]
    place = np.float32(seen + np.array(SHAPE[::-1]) / 2)
    there = ((place > 4) & (place < np.array(SHAPE[::-1]) - 5)).all(axis=1)
    marks = GridMarks(place[there], cell[there], "dots", 0)
    with pytest.raises(InputError, match=r"bends lines by -\d+ % at the corner.*give crop=\d+,"):
        fit_lens(np.zeros(SHAPE, np.float32), marks, pitch_mm=1.0)


def round_view(strength: float, view: float) -> F4:
    """A checkerboard through a strong barrel lens (a division model) and a round diaphragm."""
    y, x = (np.indices([SUB * side for side in ROUND_SHAPE]) + 0.5) / SUB
    half = np.hypot(*ROUND_SHAPE) / 2
    u, v = (x - ROUND_SHAPE[1] / 2) / half, (y - ROUND_SHAPE[0] / 2) / half
    square = u * u + v * v
    far = half / np.maximum(1 - strength * square, 0.05) / 26
    lit = np.where(square < view**2, board(far * u + 0.1 * far * v, far * v - 0.1 * far * u), 0.01)
    return np.float32(cv2.GaussianBlur(pixels(lit), (0, 0), 0.8))


def test_a_round_view_is_fitted_within_the_crop_that_is_named() -> None:
    """The middle's pitch is larger than the usual one; beyond the view the fit folds the image."""
    image = round_view(0.8, 0.42)
    with pytest.raises(InputError, match=r"folds the image beyond the marks.*give crop=") as caught:
        camera_of(image)
    ((x0, y0, x1, y1),) = re.findall(r"crop=(\d+),(\d+),(\d+),(\d+)", str(caught.value))
    found = camera_of(image[int(y0) : int(y1), int(x0) : int(x1)])
    assert found.residual < 0.15
    assert found.quality["marks"] > 60


def test_a_lens_that_two_numbers_do_not_describe_is_doubted() -> None:
    """36 % at the corner and 1.2 px of residual were taken without a word."""
    with collect_warnings([]) as notes:
        camera_of(round_view(0.8, 0.58))
    assert any("more than k1 and k2 describe; give crop=" in note for note in notes)


def test_a_tilted_lens_off_the_middle_keeps_all_its_marks() -> None:
    lens = np.float32([-0.1, 0, 0.1, 0.05, 0, 0.03, 0.1, 0.05])
    found = camera_of(pixels(dots(*on_film(SHAPE, lens, 15, 0.1, (0, 0)))))
    assert found.quality["unused_marks"] == 0
    assert found.residual < 0.05
    assert largest_departure(found.lens, lens) < 0.3


def test_every_whole_dot_is_a_mark_up_to_the_frame() -> None:
    """Those at the frame tell most of the lens; 10 px of pitch, 2.3 of radius, 4 to the frame."""
    i, j = on_film(SHAPE, NONE, 10, 0.0, (0.45, 0.45))
    marks = find_grid(pixels(dots(i, j)))
    assert (len(marks.place), marks.astray) == (32 * 24, 0)


def test_a_whole_dot_on_no_place_of_the_grid_is_counted_and_named() -> None:
    i, j = on_film(SHAPE, NONE, 20, 0.1, (0, 0))
    samples = dots(i, j)
    samples[np.hypot(i - 1.5, j - 2.5) < 0.2] = 0.15
    samples[np.hypot(i + 3.5, j + 1.5) < 0.2] = 0.15
    with collect_warnings([]) as notes:
        found = camera_of(pixels(samples))
    clean = camera_of(pixels(dots(i, j)))
    assert (found.quality["unused_marks"], clean.quality["unused_marks"]) == (2, 0)
    assert found.quality["marks"] == clean.quality["marks"]
    assert len(notes) == 1
    assert notes[0].startswith("2 whole dots are on no place of the grid and left out, at ")


RIGS = {"hand_ideal": 0.0, "hand_gloss": 0.0, "hand_lens": -0.03, "hand": -0.03}
"""By how much the corner of the image looks nearer to its middle than the middle's scale says."""


@pytest.mark.parametrize("rig", RIGS)
def test_a_rig_in_the_hand_is_found(raytraced: Path, rig: str) -> None:
    image = read_grey(file=raytraced / rig / "grid.png")
    found = camera_of(image)
    assert found.residual < 0.02
    u, v = ideal_places(found.lens, SHAPE)
    middle = np.array(SHAPE[::-1]) / 2 - 0.5
    corner = np.hypot(u[0, 0] - middle[0], v[0, 0] - middle[1]) / np.hypot(*middle)
    assert corner - 1 == pytest.approx(RIGS[rig], abs=1e-3)


@pytest.mark.parametrize("press", ["calibration", "calibration_off"])
def test_a_ball_seen_through_a_lens_is_a_ball_where_its_points_lie(
    raytraced: Path, press: str
) -> None:
    """6 mm of radius, within 3 um; without the lens 44 to 113 um too small."""
    found = camera_of(read_grey(file=raytraced / "hand_lens" / "grid.png"))
    height = np.load(raytraced / "hand_lens" / press / "truth_height_mm.npy")
    u, v = ideal_places(found.lens, SHAPE)
    cap = height > 0.3
    points = np.stack([u[cap] * found.pixel, v[cap] * found.pixel, height[cap]], axis=1)
    points = points.astype(np.float64)
    centred = points - points.mean(axis=0)
    terms = np.column_stack([2 * centred, np.ones(len(centred))])
    x = np.linalg.lstsq(terms, (centred**2).sum(axis=1), rcond=None)[0]
    assert np.sqrt(x[3] + (x[:3] ** 2).sum()) == pytest.approx(6, abs=0.003)


def stored(file: Path, lens: F4, shape: tuple[int, int] = SHAPE, pixel: float = 0.07) -> Path:
    write_camera(
        np.zeros(shape, np.float32), lens, pixel, 0.01, {"marks": 20.0}, file=file, provenance=MADE
    )
    return file


def test_a_cameras_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    lens = np.linspace(-0.01, 0.02, 8, dtype=np.float32)
    file = stored(tmp_path / "camera.npz", lens)
    frames = np.zeros((4, *SHAPE), np.float32)
    assert np.array_equal(read_lens(frames, file=file), lens)
    assert pixel_size(camera=file) == pytest.approx(0.07)
    with np.load(file, allow_pickle=False) as archive:
        about = json.loads(str(archive["about"]))
    assert about["kind"] == "tactograph camera"
    assert about["quality"] == {"marks": 20.0}


def test_a_camera_of_other_images_is_refused(tmp_path: Path) -> None:
    file = stored(tmp_path / "camera.npz", NONE)
    with pytest.raises(InputError, match="320 x 240 pixels, but these have 300 x 240"):
        read_lens(np.zeros((4, 240, 300), np.float32), file=file)


def test_a_calibration_is_refused_as_a_camera(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    np.savez(file, about=np.array(json.dumps({"kind": "tactograph calibration", "format": 1})))
    with pytest.raises(InputError, match="not a camera; 'run calibrate_camera' makes one"):
        pixel_size(camera=file)


def test_the_cameras_pixel_size_goes_before_a_stated_one_and_says_so(tmp_path: Path) -> None:
    file = stored(tmp_path / "camera.npz", NONE)
    with collect_warnings([]) as notes:
        assert pixel_size(mm=0.0701, camera=file) == pytest.approx(0.07)
        assert not notes
        assert pixel_size(mm=0.08, camera=file) == pytest.approx(0.07)
        assert pixel_size(stated=0.09, camera=file) == pytest.approx(0.07)
    assert [note.partition("instead of ")[2][:5] for note in notes] == ["0.08,", "0.09,"]
    with pytest.raises(InputError, match="give `mm`=MM"):
        pixel_size()


def test_presses_are_undistorted_one_by_one() -> None:
    lens = np.float32([0.03, 0, 0, 0, 0, 0, 0, 0])
    presses = np.random.default_rng(0).random((3, 4, 20, 30), np.float32)
    sheet = np.concatenate(list(presses), axis=1)
    known = np.float32([[3, 4, 5], [np.nan] * 3, [14.5, 9.5, 2]])
    found = undistort_presses(sheet, presses[0], known, lens)
    want = np.concatenate([undistort(press, lens) for press in presses], axis=1)
    assert np.array_equal(found.image, want)
    assert np.array_equal(found.first, want[:, :20])
    u, v = ideal_places(lens, (20, 30))
    assert np.allclose(found.circles[0], [u[4, 3], v[4, 3], 5], atol=1e-4)
    assert np.isnan(found.circles[1]).all()
    assert np.allclose(found.circles[2], known[2])


@pytest.mark.slow
def test_the_graph_writes_a_file_and_a_picture(tmp_path: Path) -> None:
    image = pixels(dots(*on_film(SHAPE, NONE, 20, 0.1, (0, 0))))
    cv2.imwrite(str(tmp_path / "grid.png"), np.uint8(255 * image))
    words = ["calibrate_camera", "image=grid.png", "pitch_mm=1.5", "out=camera.npz"]
    done = python("-m", "tactograph.graph.command", "run", *words, cwd=tmp_path)
    assert "pixel_size_mm" in done.stdout
    assert cv2.imread(str(tmp_path / "camera.png")) is not None
    assert pixel_size(camera=tmp_path / "camera.npz") == pytest.approx(0.075, rel=1e-3)


def test_a_pixel_of_one_length_or_of_two_and_no_file_are_no_lens_or_an_oblong_one() -> None:
    image = np.zeros((4, *SHAPE), np.float32)
    assert not read_lens(image).any()
    assert pixel_size(mm=0.08) == 0.08
    assert not read_lens(image, pixel_mm=(0.08,)).any()
    lens, pixel = read_lens(image, pixel_mm=(0.08, 0.1)), pixel_size(mm=(0.08, 0.1))
    assert View(lens).pixel_sides(pixel) == pytest.approx((0.08, 0.1), rel=1e-6)
    for wrong in ((0.08, 0.16), (0.16, 0.08)):
        with pytest.raises(InputError, match="no camera's are so oblong"):
            pixel_size(mm=wrong)


def test_arrays_of_other_programs_stay(tmp_path: Path) -> None:
    file, settings = tmp_path / "mine.npz", {"file": str(tmp_path / "mine.npz")}
    stored(file, np.zeros(8, np.float32))
    check_settings(write_camera, settings, str)
    np.savez(file, mine=np.ones(3))
    with pytest.raises(InputError, match=r"the name of a new file, or of an earlier .*, is needed"):
        check_settings(write_camera, settings, str)


def test_a_grid_may_be_a_colour_image(tmp_path: Path) -> None:
    colours = np.random.default_rng(1).integers(0, 255, (6, 8, 3)).astype(np.uint8)
    ImageFile(tmp_path / "grid.png").write(colours)
    found = read_grey(file=tmp_path / "grid.png")
    assert np.allclose(found, colours.mean(axis=-1) / 255, atol=1e-6)
    green = read_grey(file=tmp_path / "grid.png", channel="green")
    assert np.array_equal(green, colours[..., 1] / np.float32(255))


def test_a_lens_shows_its_numbers_and_grid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bent = np.array([0.03, 0, 0, 0, 0, 0, 0, 0], np.float32)
    file = stored(tmp_path / "camera.npz", bent)
    run_command(["show", str(file), "--out", str(tmp_path / "drawn")])
    printed = capsys.readouterr().out
    assert printed.startswith(f"{file}: camera, format 1\n")
    assert "lens        0.03 0 0 0 0 0 0 0" in printed
    assert "marks  20" in printed
    assert (tmp_path / "drawn" / "camera.png").is_file()
