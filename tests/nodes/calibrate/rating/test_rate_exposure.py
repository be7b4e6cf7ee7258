"""A flat frame under other light than the presses is reported, as it distorts every height."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.calibrate.rating.rate_exposure import rate_exposure
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.trust.other_frame import other_colours

FLAT = np.full((4, 40, 60), 0.5, np.float32)
TAKEN = FLAT + np.linspace(0, 0.1, 60, dtype=np.float32)
CIRCLE, OF = np.array([[30, 20, 8]], np.float32), np.zeros(1, np.int32)


def press(level: float, dark: float = 1.0) -> F4:
    """Film at rest of some light, and a ball in its middle whose skirt is shaded."""
    light = np.full(FLAT.shape, level, np.float32)
    light[:, 10:31, 20:41] = dark * level
    return light


def rated(
    light: F4, circle: F4 = CIRCLE, names: tuple[str, ...] = ("ball",), taken: F4 = TAKEN
) -> tuple[float, str]:
    exposure = rate_exposure(light, FLAT, taken, circle, OF, [*names])
    return exposure.quality["rest_departure_percent"], "; ".join(exposure.doubts)


def test_the_ball_and_its_skirt_do_not_count() -> None:
    departure, text = rated(press(1.01, dark=0.2))
    assert departure == pytest.approx(1, abs=1e-3)
    assert not text


@pytest.mark.parametrize(("level", "word"), [(1.25, "25% brighter"), (0.8, "20% darker")])
def test_another_exposure_is_reported(level: float, word: str) -> None:
    departure, text = rated(press(level))
    assert departure == pytest.approx(100 * (level - 1), rel=1e-3)
    assert word in text
    assert "same exposure" in text


def test_without_a_flat_frame_none_is_blamed() -> None:
    _, text = rated(press(1.25), taken=np.ones_like(FLAT))
    assert "brighter than a plain film under the LEDs that were found" in text
    assert text.endswith("as no flat frame was given: give one, `folder`=DIR")
    model = rate_exposure(press(1.25), FLAT, TAKEN, CIRCLE, OF, [""], start=Path("model.yaml"))
    assert "brighter than level film by the light model" in model.doubts[0]


def test_a_ball_alone_is_no_press() -> None:
    with pytest.raises(InputError, match="no film beside the ball"):
        rated(press(0.02, dark=50), taken=np.ones_like(FLAT))


def test_one_led_of_one_press_is_named() -> None:
    sheet = np.concatenate([press(1.0), press(1.0)], axis=1)
    sheet[2, 40:] *= 1.3
    _, text = rated(sheet, names=("first", "second"))
    assert text.startswith("second: under LED 3 ")
    _, text = rated(press(1.25))
    assert text.startswith("ball: under all LEDs the film beside the ball is 25% brighter")


def test_if_a_ball_covers_everything_all_pixels_count() -> None:
    departure, _ = rated(press(1.02), np.array([[30, 20, 50]], np.float32))
    assert departure == pytest.approx(2, abs=1e-2)


def corner_lit() -> F4:
    """The film at rest under four LEDs, each of which is brightest at its own corner."""
    y, x = np.mgrid[-1:1:80j, -1:1:120j]
    sides = (-1, -1), (1, -1), (1, 1), (-1, 1)
    return np.asarray([0.5 + 0.1 * (u * x + v * y) + 0.05 * x * x for u, v in sides], np.float32)


TURNS = {
    "mirrored left to right, or in another order": lambda a: a[:, :, ::-1],
    "turned by half, or in another order": lambda a: a[:, ::-1, ::-1],
    "in another order (taken as 2, 1, 3, 4 they fit)": lambda a: a[[1, 0, 2, 3]],
}


@pytest.mark.parametrize("words", TURNS)
def test_images_oriented_otherwise_than_the_flat_frame_are_reported(words: str) -> None:
    flat = corner_lit()
    circle = np.array([[60, 40, 12]], np.float32)
    press = TURNS[words](flat) / flat
    doubts = rate_exposure(press, flat, flat, circle, OF, [""]).doubts
    assert words in doubts[0]
    assert not rate_exposure(np.ones_like(flat), flat, flat, circle, OF, [""]).doubts


def test_colours_that_are_exchanged_are_named() -> None:
    flat = coarsen(corner_lit()[:3], factor=4)
    assert "(taken as 3, 2, 1 they fit) (are the colours RGB" in other_colours(flat[::-1], flat)
    assert not other_colours(flat, flat)


def test_a_camera_that_moved_before_the_press_is_reported() -> None:
    flat = corner_lit() ** 2
    press = np.roll(flat, 5, axis=2)
    press[:, :, :5] = press[:, :, 5:6]
    circle = np.array([[60, 40, 12]], np.float32)
    (text,) = rate_exposure(press / flat, flat, flat, circle, OF, [""]).doubts
    assert "width further right" in text


def test_a_zoom_out_is_reported_rather_than_other_light() -> None:
    """It was once reported as light that darkens."""
    flat = corner_lit() ** 2
    small = cv2.resize(np.moveaxis(flat, 0, 2), None, fx=0.9, fy=0.9, interpolation=cv2.INTER_AREA)
    press = np.moveaxis(cv2.copyMakeBorder(small, 4, 4, 6, 6, cv2.BORDER_REPLICATE), 2, 0)
    circle = np.array([[60, 40, 12]], np.float32)
    (text,) = rate_exposure(press / flat, flat, flat, circle, OF, [""]).doubts
    assert text.startswith("beside the ball the film does not lie where the flat frame shows it")


FALLING = np.linspace(0.25, 0.7, 60, dtype=np.float32)
UNEVEN = np.stack([np.broadcast_to(f, (40, 60)) for f in (FALLING, FALLING[::-1]) * 2])


@pytest.mark.parametrize(("added", "reported"), [(0.02, True), (-0.02, True), (0.005, False)])
def test_light_that_was_added_to_the_press_alone_is_reported(added: float, reported: bool) -> None:
    """Dim film departs more; LEDs that faded depart everywhere alike."""
    light = press(0.97, dark=0.2) + np.float32(added) / UNEVEN
    exposure = rate_exposure(light, UNEVEN, UNEVEN, CIRCLE, OF, ["ball"])
    assert any("the dimmer the more" in doubt for doubt in exposure.doubts) == reported


def test_light_that_flickers_while_rows_are_read_is_reported_as_bands() -> None:
    rows = np.float32(1 - 0.2 * np.sin(np.arange(40) / 2))[:, None]
    _, text = rated(press(0.85) * rows)
    assert text.startswith("ball: whole rows are brighter or darker than their neighbours")
    assert "same exposure" not in text
