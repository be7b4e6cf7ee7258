"""Many presses calibrate a sensor: bad ones are reported and left out, the others rate it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result
from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.ball_slopes import ball_slopes
from tactograph.nodes.calibrate.ball.find_balls import find_balls
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.lights.choose_presses import ChosenPresses, choose_presses
from tactograph.nodes.calibrate.rating.advise_press import advise_press
from tactograph.nodes.capture.read_balls import read_balls
from tactograph.nodes.capture.read_flat import read_flat
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.simulate.render import render
from tests.fixtures import of_matt_film, without_ranks
from tests.nodes.calibrate.lights.test_calibrate_lights import BLANK, FILM, PIXEL, RING, SIZE, off

GOOD = {"a": (52, 42, 5.0), "b": (106, 40, 4.0), "c": (60, 80, 4.0), "d": (108, 82, 5.0)}
"""x and y in px, the ball's radius in mm."""
CONTACT, GLINT = 33.0, 8.0


def pressed(x: float, y: float, radius: float) -> F4:
    center = np.array([x, y], np.float32)
    height = ball_slopes(BLANK, center, CONTACT, PIXEL, radius_mm=radius, margin_px=0.0).height
    return render(height, PIXEL, RING, samples=2).light


def write(folder: Path, light: F4, about: str = "", seed: int = 0) -> None:
    folder.mkdir(parents=True)
    noisy = 0.6 * light + np.random.default_rng(seed).normal(0, 0.002, light.shape)
    for k, plane in enumerate(np.clip(noisy, 0, 1), start=1):
        cv2.imwrite(str(folder / f"led{k}.png"), np.rint(65535 * plane).astype(np.uint16))
    if about:
        (folder / "capture.yaml").write_text(about)


def ball(x: float, y: float, radius: float) -> str:
    place = f"ball_center_px: [{x}, {y}]\nball_contact_px: {CONTACT}\n"
    return f"ball_radius_mm: {radius}\n{place}"


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five good presses, of two balls, one with a highlight, and one of each kind of bad ones."""
    folder = tmp_path_factory.mktemp("sensor")
    rest = render(FILM, PIXEL, RING).light
    write(folder / "flat" / "1", rest, seed=1)
    write(folder / "flat" / "2", rest, seed=2)
    images = {name: pressed(*place) for name, place in GOOD.items()}
    for seed, (name, place) in enumerate(GOOD.items()):
        write(folder / "presses" / name, images[name], ball(*place), seed)
    write(folder / "presses" / "e_empty", rest, "ball_radius_mm: 5\n")
    moved = images["a"].copy()
    moved[2] = np.roll(moved[2], 3, axis=1)
    write(folder / "presses" / "f_moved", moved, ball(*GOOD["a"]))
    write(folder / "presses" / "g_bright", 4 * images["b"], ball(*GOOD["b"]))
    write(folder / "presses" / "h_other", images["b"], ball(*GOOD["b"][:2], 6.0))
    y, x = np.indices(SIZE)
    glint = np.hypot(x - GOOD["b"][0] - 8, y - GOOD["b"][1]) < GLINT
    write(folder / "presses" / "i_glint", np.where(glint, 4, images["b"]), ball(*GOOD["b"]))
    return folder


def calibrate(presses: Path, out: Path, flat: Path) -> Result:
    params = {"capture": presses, "flat": flat, "pixel_size_mm": PIXEL, "out": out}
    bare = of_matt_film(without_ranks(read_graph("calibrate")))
    (result,) = open_pipeline(bare, params).items()
    return result


@pytest.fixture(scope="module")
def calibrated(sensor: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    out = tmp_path_factory.mktemp("cal") / "cal.npz"
    return calibrate(sensor / "presses", out, sensor / "flat"), out


@pytest.mark.slow
def test_bad_presses_are_left_out_and_named_with_the_reason(calibrated) -> None:
    result, _ = calibrated
    left_out = [note for note in result.warnings if "left out" in note]
    assert len(left_out) == 4
    for name, reason in {
        "e_empty": "no ball of radius 5 mm",
        "f_moved": "the ball moved by",
        "g_bright": "is saturated; expose shorter",
        "h_other": "is its radius right",
    }.items():
        assert any(f"press {name} is left out" in n and reason in n for n in left_out), name


def test_a_single_saturated_press_is_not_reported_as_an_led_that_is_off(
    sensor: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="of the ball is saturated; expose shorter"):
        calibrate(sensor / "presses" / "g_bright", tmp_path / "cal.npz", sensor / "flat")


def test_a_touched_flat_frame_is_named_as_the_reason_for_a_missing_ball() -> None:
    touched = pressed(*GOOD["d"])
    radius, known = np.full(1, 5.0, np.float32), np.full((1, 3), np.nan, np.float32)
    with pytest.raises(InputError, match="the flat frame is lit unevenly, as by a touch: take it"):
        find_balls(np.ones_like(touched), touched, radius, known, [""], PIXEL)


def test_a_ball_of_less_than_a_pixel_advises_to_check_radius_and_pixel_size() -> None:
    level = np.ones_like(pressed(*GOOD["d"]))
    radius, known = np.full(1, 0.001, np.float32), np.full((1, 3), np.nan, np.float32)
    with pytest.raises(InputError, match="shows nothing; check `radius` and `pixel`"):
        find_balls(level, level, radius, known, [""], PIXEL)


@pytest.mark.parametrize(
    ("at_rest", "why"),
    [(True, "capture shows untouched film.*exchange"), (False, "it shows a ball at 52,4[12] px")],
)
def test_a_flat_frame_with_a_ball_is_refused_before_a_film_is_fitted(at_rest, why) -> None:
    """It took up to a minute, and LEDs at infinity, or another radius, were named."""
    flat, film = pressed(*GOOD["a"]), render(FILM, PIXEL, RING).light
    flat[flat < np.quantile(flat, 0.02)] = 0  # the ball's shadow on itself
    dark = np.zeros(flat.shape[1:], np.float32)
    light = flat_field(film if at_rest else pressed(*GOOD["d"]), flat, dark)
    given = np.full(1, 5.0, np.float32), np.float32([[108, 82, CONTACT]]), [""], PIXEL
    with pytest.raises(InputError, match=why):
        find_balls(light, flat, *given)
    assert find_balls(light, flat, *given, only_warn=True).circle[0, 2] == CONTACT
    find_balls(np.asarray(pressed(*GOOD["d"]) / film, np.float32), film, *given)


def test_presses_in_another_order_are_left_out_before_a_film_is_fitted() -> None:
    """It took half a minute, until the film's fit contradicted the radius."""
    film, x, y = render(FILM, PIXEL, RING).light, *GOOD["a"][:2]
    right = pressed(*GOOD["a"]) / film
    exchanged = right * film
    exchanged[:2] = exchanged[1::-1]
    center = np.array([x, y], np.float32)
    known = ball_slopes(BLANK, center, CONTACT, PIXEL, radius_mm=5.0)
    lit = np.full(SIZE, (1 << len(film)) - 1, np.uint8)

    def chosen(*presses: F4, **settings: bool) -> ChosenPresses:
        sheet, count = np.concatenate(presses, axis=1), len(presses)
        shape = (
            np.concatenate([a] * count, axis=-2)
            for a in (known.slope, known.mask, known.height, lit)
        )
        circle = np.repeat(np.float32([[x, y, CONTACT]]), count, axis=0)
        balls = {"circle": circle, "of": np.arange(count)}
        return choose_presses(
            0.5 * sheet, sheet, film, *shape, PIXEL, ["1", "2"], **balls, **settings
        )

    wrong = np.asarray(exchanged / film, np.float32)
    with pytest.raises(InputError, match=r"in another order .*2, 1.*only_warn"):
        chosen(wrong)
    assert chosen(wrong, only_warn=True).selection.all()
    with collect_warnings([]) as notes:
        assert chosen(np.asarray(right, np.float32), wrong).selection.tolist() == [1, 0]
    assert "press 2 is left out: beside the ball the images show" in notes[0]
    noise = np.random.default_rng(1).normal(0, 0.01, right.shape)
    alike = np.asarray(right.mean(axis=0) + noise, np.float32)
    with pytest.raises(InputError, match="LED 1 and LED 2 show the ball in the same light"):
        chosen(alike)
    assert chosen(alike, only_warn=True).selection.all()
    with collect_warnings([]) as notes:
        assert chosen(np.asarray(right, np.float32), alike).selection.tolist() == [1, 0]
    assert "press 2 is left out: the images of LED 1 and LED 2 show the ball" in notes[0]


def test_the_leds_are_placed_by_the_good_presses_alone(calibrated) -> None:
    _, out = calibrated
    assert off(read_calibration(file=out).film.lights, RING) < 0.005


def test_errors_are_of_presses_held_out(calibrated) -> None:
    quality = calibrated[0]["quality"]
    assert quality["presses"] == 5
    assert 0.05 < quality["heldout_normal_deg"] < 1
    assert 0.1 < quality["heldout_height_um"] < 10


def test_the_tables_hold_pixels_of_all_good_presses_and_of_no_bad_one(calibrated) -> None:
    result, out = calibrated
    used = [part.any() for part in np.split(result["mask"], 9)]
    assert used == [True] * 4 + [False] * 4 + [True]
    entries = len(read_calibration(file=out).lut_slope)
    assert entries == pytest.approx(5 * np.pi * CONTACT**2, rel=0.1)


def test_saturated_highlights_are_left_out_of_a_press(calibrated) -> None:
    plain, glinting = (np.split(calibrated[0]["mask"], 9)[i] for i in (1, 8))
    lost = int(plain.sum()) - int(glinting.sum())
    assert lost == pytest.approx(np.pi * GLINT**2, rel=0.05)


def test_a_picture_is_written_next_to_the_calibration(calibrated) -> None:
    _, out = calibrated
    picture = cv2.imread(str(out.with_suffix(".png")))
    assert picture.shape == (800, 1720, 3)


@pytest.mark.slow
def test_one_press_has_nothing_to_hold_out(sensor: Path, tmp_path: Path) -> None:
    result = calibrate(sensor / "presses" / "a", tmp_path / "cal.npz", sensor / "flat" / "1")
    assert result["quality"]["presses"] == 1
    assert "heldout_normal_deg" not in result["quality"]
    assert "press at the upper right" in result["advice"]
    assert off(read_calibration(file=tmp_path / "cal.npz").film.lights, RING) < 0.01


def test_the_radius_and_circle_of_a_ball_are_read_with_its_press(sensor: Path) -> None:
    with collect_warnings([]) as notes:
        balls = read_balls(folder=sensor / "presses", radius_mm=5.0)
    instead = "capture.yaml of b, c, g_bright, h_other, i_glint is used instead of `radius_mm`"
    assert sum(instead in note for note in notes) == 1
    assert balls.image.shape == (4, 9 * SIZE[0], SIZE[1])
    assert balls.radius.tolist() == [5, 4, 4, 5, 5, 5, 4, 6, 4]
    assert balls.circles[1].tolist() == [106, 40, CONTACT]
    assert np.isnan(balls.circles[4]).all()


def test_radii_are_assigned_in_the_order_of_the_names(tmp_path: Path) -> None:
    for name in ("two", "one"):
        write(tmp_path / name, np.ones((3, 4, 5), np.float32))
    assert read_balls(folder=tmp_path, radius_mm=(7.0, 5.0)).names == ["one", "two"]
    assert read_balls(folder=tmp_path, radius_mm=(7.0, 5.0)).radius.tolist() == [7, 5]
    assert read_balls(folder=tmp_path, radius_mm=7.0).radius.tolist() == [7, 7]


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({}, r"one: the ball's radius is not known; give `radius_mm`"),
        ({"radius_mm": (7.0, 5.0, 4.0)}, "presses: 2, radii in `radius_mm`: 3"),
        ({"radius_mm": 7.0, "center_px": (3.0, 3.0)}, "`center_px` and `contact_px` are for"),
    ],
)
def test_balls_that_do_not_fit_the_presses_are_refused(tmp_path: Path, settings, why: str) -> None:
    for name in ("one", "two"):
        write(tmp_path / name, np.ones((3, 4, 5), np.float32))
    with pytest.raises(InputError, match=why):
        read_balls(folder=tmp_path, **settings)


def test_presses_of_different_sizes_or_of_the_untouched_film_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "one", np.ones((3, 4, 5), np.float32))
    write(tmp_path / "two", np.ones((3, 4, 6), np.float32))
    with pytest.raises(InputError, match="two: is 3 lights of 6 x 4 pixels, but one is"):
        read_balls(folder=tmp_path, radius_mm=7.0)
    with pytest.raises(InputError, match="is the folder of the presses; give another"):
        read_balls(folder=tmp_path, flat=tmp_path / "one" / "..", radius_mm=7.0)


def test_several_captures_of_the_untouched_film_are_averaged(tmp_path: Path) -> None:
    for seed in range(4):
        write(tmp_path / str(seed), np.ones((3, 60, 80), np.float32), seed=seed)
    image = np.ones((3, 60, 80), np.float32)
    one = read_flat(image, folder=tmp_path / "0", smooth_px=0.0).flat
    mean = read_flat(image, folder=tmp_path, smooth_px=0.0).flat
    assert mean.std() == pytest.approx(one.std() / 2, rel=0.1)


def covered(*places: tuple[float, float], contact: float = 40.0) -> str:
    known = [
        ball_slopes(BLANK, np.array(c, np.float32), contact, PIXEL, radius_mm=5.0) for c in places
    ]
    slope = np.concatenate([k.slope for k in known], axis=1)
    mask = np.concatenate([k.mask for k in known])
    return advise_press(BLANK, slope, mask, np.full(mask.shape, 15, np.uint8)).advice


@pytest.mark.parametrize(
    ("places", "contact", "advice"),
    [
        ([(40, 40), (120, 40), (120, 80)], 40, "press at the lower left: no contact reaches"),
        ([(40, 40), (120, 40), (120, 80)], 30, "press at the lower left, deeper, or with a sma"),
        ([(40, 40), (120, 40), (120, 80)], 45, "press at the lower left: contacts cover "),
        ([(40, 40), (120, 40), (120, 80), (40, 80)], 40, "nothing more is needed"),
        ([(40, 40)], 49, "and a single press cannot be checked by another"),
    ],
)
def test_the_advice_names_the_next_press(places, contact: float, advice: str) -> None:
    text = covered(*places, contact=contact)
    assert advice in text


def test_presses_are_refused_if_no_ball_is_found_in_any_of_them(tmp_path: Path) -> None:
    radius, known = np.full(2, 1.0, np.float32), np.full((2, 3), np.nan, np.float32)
    sheet = np.ones((4, 2 * SIZE[0], SIZE[1]), np.float32)
    marks = np.array([[20, 20, 1], [40, 20, 1]], np.float32)
    with pytest.raises(InputError, match="none of 2 presses"):
        find_balls(sheet, BLANK + 1, radius, known, ["a", "b"], PIXEL, marks)
