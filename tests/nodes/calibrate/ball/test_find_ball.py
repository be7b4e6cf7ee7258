"""The calibration ball is found where it is, and nothing else is taken for one."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph import InputError
from tactograph.nodes.calibrate.ball.find_ball import find_ball
from tests.fixtures import Raytraced, real_data
from tests.nodes.calibrate.film.test_judge_radius import image_of

PIXEL = 0.1
SIZE = (120, 160)
SLANT = np.deg2rad(30)


def lambert(p, q, lights=4):
    """Distant LEDs over slopes p, q; 1 on the flat film."""
    azimuths = 0.7 + 2 * np.pi * np.arange(lights) / lights
    cosines = [1 - np.tan(SLANT) * (p * np.cos(a) + q * np.sin(a)) for a in azimuths]
    return np.float32(np.maximum(cosines, 0) / np.sqrt(1 + p * p + q * q))


def pressed(center, contact, radius, lights=4, noise=0.005, fold=0.25):
    """A ball in a soft film: its slope up to the contact, then falling to 0 over the fold."""
    y, x = np.indices(SIZE, float)
    dx, dy = x - center[0], y - center[1]
    r = np.hypot(dx, dy)
    sine = np.minimum(r, contact) / radius
    fall = np.clip(1 - (r - contact) / (fold * contact), 0, 1)
    steepness = sine / np.sqrt(1 - sine**2) * fall / np.maximum(r, 1e-9)
    light = lambert(-dx * steepness, -dy * steepness, lights)
    return light + np.random.default_rng(1).normal(0, noise, light.shape).astype(np.float32)


def uneven(light):
    """The same light as captured without a flat frame to divide by."""
    y, x = np.indices(SIZE)
    falls = [
        0.6 + sx * 0.001 * (x - 80) + sy * 0.001 * (y - 60) for sx in (-1, 1) for sy in (-1, 1)
    ]
    return np.float32(light * falls[: len(light)])


def normalized(rig, thing):
    flat = image_of(Raytraced() / rig / "flat")
    return image_of(Raytraced() / rig / thing) / np.maximum(flat, np.float32(0.02))


@settings(max_examples=3)
@given(
    x=st.floats(45, 115), y=st.floats(45, 75), contact=st.floats(22, 32), lights=st.integers(3, 6)
)
def test_ball_in_soft_film_is_found_to_a_fraction_of_a_pixel(x, y, contact, lights):
    ball = find_ball(pressed((x, y), contact, 40, lights), PIXEL, radius_mm=4.0)
    np.testing.assert_allclose(ball.center, (x, y), atol=0.3)
    assert ball.contact == pytest.approx(contact, abs=2)
    assert ball.goodness > 0.9


@pytest.mark.parametrize("share", [0.1, 0.15, 0.24])
def test_a_shallow_press_of_a_large_ball_is_found(share):
    radius = 124.14
    light = pressed((70.3, 64.8), share * radius, radius, lights=3, noise=0.003)
    ball = find_ball(light, PIXEL, radius_mm=radius * PIXEL)
    assert np.allclose(ball.center, (70.3, 64.8), atol=0.5)
    assert ball.contact == pytest.approx(share * radius, rel=0.1)


@pytest.mark.parametrize("center", [(5.3, 60.2), (90.4, -4.0), (155.0, 112.0)])
def test_ball_partly_outside_the_image_is_found(center):
    ball = find_ball(pressed(center, 28, 40), PIXEL, radius_mm=4.0)
    np.testing.assert_allclose(ball.center, center, atol=1)


def test_the_ball_is_found_under_uneven_light_without_a_flat_frame():
    ball = find_ball(uneven(pressed((70.3, 55.8), 27, 40)), PIXEL, radius_mm=4.0)
    np.testing.assert_allclose(ball.center, (70.3, 55.8), atol=0.5)


def test_a_stated_centre_and_contact_are_used_unchanged():
    light = pressed((70, 55), 27, 40)
    right = find_ball(light, PIXEL, radius_mm=4.0, center_px=(70.0, 55.0), contact_px=27.0)
    wrong = find_ball(light, PIXEL, radius_mm=4.0, center_px=(110.0, 70.0), contact_px=20.0)
    np.testing.assert_array_equal(wrong.center, [110, 70])
    assert wrong.contact == 20
    assert right.goodness > 0.9 > 0.45 > wrong.goodness


def test_centre_or_contact_is_searched_if_only_the_other_is_stated():
    light = pressed((70.3, 55.8), 27, 40)
    by_center = find_ball(light, PIXEL, radius_mm=4.0, center_px=(70.3, 55.8))
    assert by_center.contact == pytest.approx(27, abs=2)
    by_contact = find_ball(light, PIXEL, radius_mm=4.0, contact_px=27.0)
    assert by_contact.contact == pytest.approx(27)
    np.testing.assert_allclose(by_contact.center, (70.3, 55.8), atol=0.3)


@pytest.mark.parametrize(
    ("level", "reason"),
    [(0.0, "the best circle"), (1.0, "the press shows what the flat frame shows")],
)
def test_empty_film_is_refused_and_the_remedy_is_named(level, reason):
    noise = np.random.default_rng(2).normal(0, 0.004, (4, *SIZE))
    with pytest.raises(InputError, match=rf"no ball .*{reason}.*`center_px`=X,Y") as error:
        find_ball(np.float32(level + noise), PIXEL, radius_mm=4.0)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("center", "contact", "radius", "why"),
    [
        ((1e9, -1e9), 10.0, 4.0, "at 1e.09,-1e.09 lies beside the image of"),
        ((-12.0, 5.0), 10.0, 4.0, "beside the image"),
        ((1e5, 3.0), None, 4.0, "beside the image"),
        ((-35.0, 55.0), None, 4.0, "no ball of radius 4 mm found: the best circle, at -35,55 px"),
        ((70.0, 55.0), 1e-9, 4.0, "a contact of 1e-09 px shows no ball"),
        (None, 0.5, 4.0, "a contact of 0.5 px shows no ball"),
        (None, None, 1e-5, r"1e-05 mm radius .* check its radius"),
        (None, 41.0, 4.0, r"a contact of 41 px is larger than the ball.*40\.0 px"),
    ],
)
def test_a_circle_that_shows_no_ball_is_refused(center, contact, radius, why):
    light = pressed((70, 55), 27, 40)
    with pytest.raises(InputError, match=why):
        find_ball(light, PIXEL, radius_mm=radius, center_px=center, contact_px=contact)


def test_a_contact_that_a_large_image_hardly_shows_has_no_goodness():
    light = np.ones((4, 60, 4000), np.float32)
    ball = find_ball(light, PIXEL, radius_mm=4.0, center_px=(2000.0, 30.0), contact_px=1.0)
    assert ball.goodness == 0


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "scale", "divided"),
    [("far28", 1, True), ("near33", 1, True), ("near33", 1, False), ("far28_vga16", 2, True)],
)
def test_ray_traced_hemisphere_is_found_through_its_shadows(rig, scale, divided):
    folder = Raytraced() / rig / "calibration"
    light = normalized(rig, "calibration") if divided else image_of(folder)
    height = np.load(folder / "truth_height_mm.npy")
    y, x = np.nonzero(height > 0.99 * height.max())
    ball = find_ball(light, 1 / (14 * scale), radius_mm=7.0)
    np.testing.assert_allclose(ball.center, (x.mean(), y.mean()), atol=0.2 * scale)
    assert ball.contact == pytest.approx(98 * scale, abs=0.5)
    assert ball.goodness > 0.9


@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_ray_traced_soft_press_is_found(rig):
    ball = find_ball(normalized(rig, "sphere_film"), 1 / 14, radius_mm=6.0)
    np.testing.assert_allclose(ball.center, (149.6, 125.5), atol=0.2)
    # The truth keeps the ball's slope up to 66 px; a smaller contact does no harm.
    assert 60 < ball.contact < 68


@pytest.mark.parametrize("thing", ["cat", "cat_film"])
def test_other_objects_are_refused(thing):
    with pytest.raises(InputError, match="no ball"):
        find_ball(normalized("near33", thing), 1 / 14, radius_mm=7.0)


def test_real_presses_agree_with_their_labels():
    folder = real_data("gelsight_mini_balls")
    flat = cv2.imread(str(folder / "background.png")) / np.float32(255)
    labels = np.genfromtxt(folder / "labels.csv", delimiter=",", skip_header=1, usecols=(2, 3, 4))
    # The left half: on the right, where the light is weak, the labels themselves are inaccurate.
    presses = (18, 24, 29, 41)
    errors = []
    for press in presses:
        image = cv2.imread(str(folder / f"6.310mm/{press}/gelsight.png")) / np.float32(255)
        light = np.ascontiguousarray((image / flat).transpose(2, 0, 1))
        ball = find_ball(light, 0.0634, radius_mm=6.31 / 2)
        errors.append(np.subtract([*ball.center, ball.contact], labels[press]))
    off = np.median(np.abs(errors), axis=0)
    assert np.hypot(off[0], off[1]) < 1.5
    assert off[2] < 1.5
