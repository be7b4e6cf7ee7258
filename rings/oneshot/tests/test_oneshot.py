"""A sensor whose three colours light every place of the film differently."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError, Provenance
from tactograph.graph.errors import collect_warnings
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.calibrate.ball.find_ball import find_ball
from tactograph.nodes.calibrate.rating.pressed_ball import PressedBall
from tactograph.rings.oneshot.nodes.file.read_press_calibration import read_press_calibration
from tactograph.rings.oneshot.nodes.file.write_press_calibration import write_press_calibration
from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    PLACE_TERMS,
    SHADE_COUNT,
    shades,
    terms,
)
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solve_reflectance_map
from tactograph.rings.oneshot.nodes.presses.find_presses import find_presses
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import (
    degree_for,
    fit_reflectance_map,
)
from tactograph.rings.oneshot.nodes.presses.rate_presses import advise
from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses
from tests.fixtures import real_data

SHAPE = (72, 96)
PIXEL, RADIUS_MM = 0.1, 2.5
PX = 0.0634
RADIUS, CONTACT = 25.0, 13.0
RIM = 0.2
FLAT = np.full((3, *SHAPE), 0.4, np.float32)
MADE = Provenance({}, None, [], {}, {}, [], [])


def true_map() -> np.ndarray:
    """Three near lights: how strongly each answers to a slope changes over the film."""
    found = np.zeros((3, SHADE_COUNT, PLACE_TERMS))
    azimuth = np.array([0.3, 2.4, 4.5])
    found[:, 0, 0], found[:, 1, 0], found[:, 2, 0] = (
        0.7 * np.cos(azimuth),
        0.7 * np.sin(azimuth),
        0.9,
    )
    found[:, 0, 1], found[:, 1, 2] = (0.15, -0.1, 0.1), (-0.12, 0.1, 0.08)
    found[:, 4, 0] = 0.1
    found[:, 8, 0], found[:, 8, 2] = 0.25, 0.1
    return found


def light_of(slope: np.ndarray, height: np.ndarray) -> np.ndarray:
    y, x = (i.ravel().astype(float) for i in np.indices(SHAPE))
    shade, place = (
        shades(slope.reshape(2, -1).astype(float), height.ravel().astype(float)),
        terms(x, y, SHAPE),
    )
    light = 1 + np.einsum("kbq,bn,qn->kn", true_map(), shade, place)
    return np.asarray(light.reshape(3, *SHAPE), np.float32)


def pressed(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Slope and height of a film over a ball: its cap, and a skirt that falls to the rest."""
    row, column = (i.astype(float) for i in np.indices(SHAPE))
    slope, rise = PressedBall(np.array([x, y, CONTACT]), RADIUS, PIXEL).shape(column, row)
    r = np.hypot(column - x, row - y)
    inside = r < CONTACT
    steep = CONTACT / np.sqrt(RADIUS**2 - CONTACT**2)
    length = RIM / (steep * PIXEL)
    fall = np.exp(-np.maximum(r - CONTACT, 0) / length)
    outward = -np.stack([column - x, row - y]) / np.maximum(r, 1e-9)
    return (
        np.where(inside, slope, steep * fall * outward),
        np.where(inside, rise + RIM, RIM * fall),
    )


CENTERS = [(x + 0.3, y - 0.2) for y in (18, 36, 54) for x in (16, 32, 48, 64, 80)]


def presses(centers: list[tuple[float, float]] = CENTERS) -> np.ndarray:
    rng = np.random.default_rng(3)
    light = np.stack([light_of(*pressed(x, y)) for x, y in centers])
    return np.asarray(0.4 * light + rng.normal(0, 0.001, light.shape), np.float32)


@pytest.fixture(scope="module")
def fitted():
    """A map fitted from circles of which one is off by 2.5 px."""
    circle = np.array([(*c, CONTACT) for c in CENTERS], np.float32)
    circle[7, :2] += (2.0, -1.5)
    names = [str(i) for i in range(len(CENTERS))]
    return fit_reflectance_map(presses(), FLAT, names, circle, PIXEL, radius_mm=RADIUS_MM)


def test_a_reflectance_that_varies_is_recovered_and_a_wrong_centre_put_right(fitted) -> None:
    assert fitted.selection.all()
    assert fitted.residual.max() < 0.01
    assert fitted.rim == pytest.approx(RIM, abs=0.06)
    np.testing.assert_allclose(fitted.circle[:, :2], CENTERS, atol=0.4)


def test_three_lights_suffice_for_an_unseen_press(fitted) -> None:
    slope, height = pressed(40.0, 30.0)
    light = light_of(slope, height)
    found = solve_reflectance_map(light, FLAT, height.astype(np.float32), fitted.reflectance)
    circle = np.array([40.0, 30.0, CONTACT])
    degrees, microns, _ = PressedBall(circle, RADIUS, PIXEL).errors(found, height)
    assert degrees < 1.5
    assert microns < 1


def test_the_film_at_rest_has_no_slope() -> None:
    light = np.ones((3, *SHAPE), np.float32)
    found = solve_reflectance_map(
        light, FLAT, np.zeros(SHAPE, np.float32), true_map().astype(np.float32)
    )
    assert np.abs(found).max() < 1e-6


def test_height_that_is_not_fed_back_is_taken_for_slope() -> None:
    slope, height = pressed(40.0, 30.0)
    light, known = light_of(slope, height), true_map().astype(np.float32)
    with_height = solve_reflectance_map(light, FLAT, height.astype(np.float32), known)
    without = solve_reflectance_map(light, FLAT, 0 * height.astype(np.float32), known)
    assert 10 * np.abs(with_height - slope).mean() < np.abs(without - slope).mean()


def test_a_press_that_shows_something_else_is_left_out_and_named() -> None:
    images = presses()
    images[7] = images[7][:, :, ::-1]
    circle = np.array([(*c, CONTACT) for c in CENTERS], np.float32)
    names = [f"press{i}" for i in range(len(CENTERS))]
    with collect_warnings([]) as notes:
        found = fit_reflectance_map(images, FLAT, names, circle, PIXEL, radius_mm=RADIUS_MM)
    assert list(np.flatnonzero(found.selection == 0)) == [7]
    assert notes == ["press press7 is left out: its light does not fit that of the others"]


def test_an_empty_film_is_left_out_and_named() -> None:
    images = presses(CENTERS[5:10])
    images[2] = 0.4
    with collect_warnings([]) as notes:
        found = find_presses(images, FLAT, list("abcde"), PIXEL, radius_mm=RADIUS_MM)
    assert notes == ["press c is left out: no ball of radius 2.5 mm in it"]
    assert found.circle[2, 2] == 0 == found.goodness[2]
    np.testing.assert_allclose(found.circle[0, :2], CENTERS[5], atol=1.5)


def test_a_stated_contact_is_not_searched_for() -> None:
    images = np.full((4, 3, *SHAPE), 0.4, np.float32)
    stated = np.full((4, 3), np.nan, np.float32)
    stated[1] = 30, 20, 11
    found = find_presses(
        images, FLAT, list("abcd"), PIXEL, stated, radius_mm=RADIUS_MM, min_balls=1
    )
    assert np.array_equal(found.circle[1], stated[1])
    assert list(np.flatnonzero(found.goodness)) == [1]


def test_too_few_balls_are_refused() -> None:
    images = np.full((5, 3, *SHAPE), 0.4, np.float32)
    with pytest.raises(InputError, match=r"in 0 of 5 presses, and 4 are needed: none in a, b, c"):
        find_presses(images, FLAT, list("abcde"), PIXEL, radius_mm=RADIUS_MM)


def test_polynomials_grow_with_the_number_of_presses() -> None:
    assert [degree_for(n) for n in (4, 6, 12, 20, 30, 99)] == [0, 1, 2, 3, 4, 4]


def test_the_emptiest_part_of_the_film_is_to_be_pressed_next() -> None:
    counts = np.ones((4, 6), np.float32)
    assert advise(counts, (240, 320), 0.6).endswith("nothing more is needed")
    assert advise(counts, (240, 320), 0.3).startswith("press deeper")
    counts[:, 5] = 0
    assert "around 293,30 px" in advise(counts, (240, 320), 0.6)


def colour(file: Path, planes: np.ndarray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(
        str(file), np.clip(255 * planes.transpose(1, 2, 0), 0, 255).round().astype(np.uint8)
    )


def test_presses_are_read_from_folders_whatever_their_images_are_called(tmp_path: Path) -> None:
    for name, image in zip("ab", presses(CENTERS[:2]), strict=True):
        colour(tmp_path / "presses" / name / f"image_{name}.png", image)
    colour(tmp_path / "background.png", FLAT)
    found = read_presses(folder=tmp_path / "presses", flat=tmp_path / "background.png")
    assert found.names == ["a", "b"]
    assert found.image.shape == (2, 3, *SHAPE)
    np.testing.assert_allclose(found.flat, 0.4, atol=1e-6)


def test_a_film_of_another_size_is_refused(tmp_path: Path) -> None:
    colour(tmp_path / "presses" / "a" / "x.png", presses(CENTERS[:1])[0])
    colour(tmp_path / "background.png", FLAT[:, :50])
    with pytest.raises(InputError, match="is 3 lights of 96 x 50 pixels, but the capture is"):
        read_presses(folder=tmp_path / "presses", flat=tmp_path / "background.png")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    target, reflectance = tmp_path / "cal.npz", true_map().astype(np.float32)
    kept = FLAT, PIXEL, reflectance, {"presses": 9.0}, "the presses cover the film"
    write_press_calibration(*kept, file=target, provenance=MADE)
    return target


def change(file: Path, **arrays) -> None:
    with np.load(file) as archive:
        kept = {**archive, **arrays}
    np.savez(file, **{name: array for name, array in kept.items() if array is not None})


def test_a_written_file_is_read_and_a_fresh_flat_frame_replaces_its_own(file: Path) -> None:
    found = read_press_calibration(file=file)
    np.testing.assert_array_equal(found.flat, FLAT)
    np.testing.assert_array_equal(found.reflectance, true_map().astype(np.float32))
    assert found.pixel_size == pytest.approx(PIXEL)
    assert not found.dark.any()
    today = file.with_name("today.png")
    colour(today, 0.6 + 0 * FLAT)
    np.testing.assert_allclose(read_press_calibration(file=file, flat=today).flat, 0.6, atol=1e-6)


def test_a_calibration_of_the_other_order_of_colours_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "cal.npz"
    made = Provenance({}, None, [], {}, {}, [], [], {"lights": "bgr"})
    reflectance = true_map().astype(np.float32)
    write_press_calibration(FLAT, PIXEL, reflectance, {}, "", file=target, provenance=made)
    with pytest.raises(
        InputError, match="made of colours in the order bgr, not rgb; give `lights`=bgr"
    ):
        read_press_calibration(file=target, lights="rgb")
    read_press_calibration(file=target, lights="bgr")


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"reflectance": None}, "'reflectance' is missing"),
        ({"reflectance": np.zeros((3, 9, 10), np.float32)}, r"shape \(3, 9, 10\)"),
        ({"flat": np.full_like(FLAT, np.nan)}, "'flat' holds NaN"),
        ({"pixel_size": np.float32(-1)}, "'pixel_size' holds -1, which no sensor has"),
        ({"flat": FLAT.astype(np.float64)}, "'flat' is float64"),
        ({"about": np.array("{}")}, "not a press calibration"),
        ({"about": np.array(json.dumps({"kind": "x", "format": 1}))}, "is a x, not a press"),
        ({"flat": np.array([{}], dtype=object)}, "pickle"),
    ],
)
def test_a_damaged_file_is_refused_with_the_reason(file: Path, arrays: dict, why: str) -> None:
    change(file, **arrays)
    with pytest.raises(InputError, match=why) as error:
        read_press_calibration(file=file)
    assert "\n" not in str(error.value)


def test_a_file_that_is_cut_off_or_missing_is_refused(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:900])
    with pytest.raises(InputError, match="damaged"):
        read_press_calibration(file=file)
    with pytest.raises(InputError, match="'run calibrate_presses' makes one"):
        read_press_calibration(file=file.with_name("none.npz"))


@pytest.mark.slow
def test_a_real_sensor_measures_a_press_that_it_was_not_calibrated_with(tmp_path: Path) -> None:
    data, calibration = real_data("gelsight_mini_balls"), tmp_path / "cal.npz"
    # Around the press that is held out: a map of few presses holds where they are.
    around = (13, 14, 15, 18, 19, 20, 21, 24, 25, 26, 39, 42)
    held_out = 19
    images = read_presses(folder=data / "6.310mm", flat=data / "background.png")
    index = [images.names.index(str(n)) for n in around]
    stack = np.ascontiguousarray(images.image[index])
    labels = np.genfromtxt(data / "labels.csv", delimiter=",", skip_header=1, usecols=(2, 3, 4))
    circle = labels[list(around)].astype(np.float32)
    circle[around.index(held_out), 2] = 0
    names = [str(n) for n in around]
    fit = fit_reflectance_map(stack, images.flat, names, circle, PX, radius_mm=3.155, rounds=3)
    kept = images.flat, PX, fit.reflectance, {}, ""
    write_press_calibration(*kept, file=calibration, provenance=MADE)
    arguments = {"capture": data / f"6.310mm/{held_out}", "calibration": calibration}
    (result,) = open_pipeline("gelsight_mini", {**arguments, "out": tmp_path / "out"}).items()
    slope, height = result.outputs["slope"], result.outputs["height"]
    light = stack[around.index(held_out)] / images.flat
    ball = find_ball(light, PX, radius_mm=3.155)
    true = np.array([*ball.center, ball.contact], float)
    degrees, _, percent = PressedBall(true, 3.155 / PX, PX).errors(slope, height)
    assert degrees < 2.7
    assert percent < 5
