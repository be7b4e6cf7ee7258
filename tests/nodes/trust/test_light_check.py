"""The light of a touch as a whole, from its pixels' departures."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust._check import DARK_AS_DUE, Check
from tactograph.nodes.trust._light_check import (
    MAX_BRIGHTNESS,
    MAX_MEDIAN,
    MAX_REST,
    MIN_BRIGHTNESS_ERROR,
    check_light,
)
from tactograph.nodes.trust._light_evidence import light_evidence

SHAPE = (30, 40)
ALL = 0b1111
TOUCHED = np.s_[..., 10:20, 10:30]
Touch = dict[str, F4]


def plane(value: float, touched: float | None = None) -> F4:
    """A value everywhere, and perhaps another one in the middle."""
    made = np.full(SHAPE, value, np.float32)
    made[TOUCHED] = value if touched is None else touched
    return made


def touch(
    departs: float = 1.0, at_rest: float = 1.0, used: int = ALL, lit: float = 0.0, dark: int = 0
) -> Touch:
    """A touch in the middle: its departure, the LEDs used, and light in so many shadow pixels."""
    shadow, matt = np.zeros(SHAPE, np.uint8), np.ones((4, *SHAPE), np.float32)
    shadow.flat[:dark] = 0b0100
    matt[2].flat[:dark] = lit
    return {
        "departure": plane(at_rest, departs), "slope": np.stack([plane(0, 0.4), plane(0)]),
        "misfit": np.zeros(5, np.float32), "brighter": plane(0),
        "used": plane(ALL, used).astype(np.uint8), "matt": matt, "shadow": shadow,
    }  # fmt: skip


def told(what: Touch, rim_error: float = 0.0, brightness_error: float = 0.0) -> Check:
    found = light_evidence(**what)  # type: ignore[arg-type]
    return check_light(found, rim_error, brightness_error)


def darker(share: float, used: int = ALL) -> Touch:
    """A touch whose slopes change the light by a third, and that is darker by a share."""
    changed = np.stack([plane(1, 4 / 3), plane(1, 2 / 3)] * 2) * plane(1, 1 - share)
    return touch(used=used) | {"matt": changed, "brighter": plane(0, -share)}


def walls(width: int) -> Touch:
    """The two walls of a groove, so many cells wide, darker than their slopes say."""
    slope = np.zeros((2, *SHAPE), np.float32)
    slope[0, 5:25, 10 : 10 + width], slope[0, 5:25, 24 : 24 + width] = 0.5, -0.5
    steep = slope[0] != 0
    seen = {
        "slope": slope,
        "departure": np.where(steep, np.float32(20), np.float32(1)),
        "brighter": np.where(steep, np.float32(-0.03), np.float32(0)),
        "matt": np.where(steep, np.float32(1.3), np.ones((4, 1, 1), np.float32)),
    }
    return touch() | seen


@pytest.mark.parametrize(("width", "told_wrong"), [(2, False), (3, False), (7, True)])
def test_walls_a_few_cells_wide_are_not_compared(width: int, told_wrong: bool) -> None:
    assert (told(walls(width)).figure > 1) == told_wrong


def test_light_of_no_surface_is_told_and_that_of_one_passes() -> None:
    assert told(touch()).figure < 0.9
    known = ("departure", "slope", "misfit")
    assert told({name: touch()[name] for name in known}).figure < 0.9, "labels may be missing"
    check = told(touch(departs=16.0))
    assert check.figure == pytest.approx(4 / MAX_MEDIAN)
    assert "no surface" in str(check)
    assert "order of the images" in str(check)


def test_a_quarter_that_is_wrong_is_told_too() -> None:
    what = touch()
    what["departure"][10:14, 10:30] = 25.0
    what["departure"][14:20, 10:30] = 0.5
    assert told(what).figure < 1 + 1e-6
    what["departure"] = plane(25)
    what["departure"][10:15] = 0.5
    assert told(what).figure > 1


def test_film_at_rest_that_departs_from_pixel_to_pixel_is_told() -> None:
    check = told(touch(at_rest=4.0))
    assert check.figure == pytest.approx(2 / MAX_REST)
    assert "compressed" in str(check)


def test_rims_in_shadow_are_allowed_an_error_and_are_told_of_precise() -> None:
    what = touch(departs=16.0, used=0b0111)
    assert told(what, rim_error=0.0).figure > 1 > told(what, rim_error=1.5).figure
    assert "need the graph precise" in str(told(what))
    without_rims = touch(departs=16.0)
    assert told(without_rims, rim_error=1.5).figure > 1


def test_shadows_with_other_light_are_told_and_dark_or_few_ones_pass() -> None:
    assert told(touch(lit=0.002, dark=200)).figure < 0.9
    assert told(touch(lit=0.5, dark=40)).figure < 0.9
    check = told(touch(lit=0.03, dark=200))
    assert check.figure == pytest.approx(2)
    assert "shadows are not dark" in str(check)


@pytest.mark.parametrize(("share", "sense"), [(0.02, "darker"), (-0.02, "brighter")])
def test_touched_film_is_as_bright_as_its_slopes_say(share: float, sense: str) -> None:
    check = told(darker(share))
    assert check.figure == pytest.approx(0.02 / (MAX_BRIGHTNESS * MIN_BRIGHTNESS_ERROR), rel=1e-3)
    assert f"{sense} by 2.0%" in str(check)
    assert told(darker(0.0)).figure < 0.9


def test_brightness_may_vary_as_the_calibration_found_it_to() -> None:
    assert told(darker(0.02), brightness_error=0.03).figure < 0.9
    assert told(darker(0.02, used=0b0111), rim_error=20.0).figure < 0.9
    assert "darker" not in str(told(darker(0.5, used=0b0101))), "two LEDs tell no brightness"


@pytest.mark.parametrize(("cells", "is_dirt"), [(3, False), (8, True)])
def test_film_that_all_leds_leave_dark_is_dirt(cells: int, is_dirt: bool) -> None:
    what = darker(0.0)
    what["brighter"][12, 12 : 12 + cells] = -0.5
    check = told(what)
    assert "dirt and hairs" in str(check)
    assert (check.figure > 1) == is_dirt


def test_images_that_are_alike_are_film_that_is_dark_without_a_slope() -> None:
    alike = touch() | {"matt": np.stack([plane(1, 0.7)] * 4), "brighter": plane(0, -0.3)}
    alike["slope"] = 0 * alike["slope"]
    assert told(alike, brightness_error=0.05).figure > 1


def test_a_touch_under_two_leds_is_told() -> None:
    check = told(touch(departs=-1.0, used=0b0011))
    assert check.figure > 1
    assert "only two LEDs" in str(check)
    assert told(touch(departs=DARK_AS_DUE, used=0b0011)).figure < 0.9


@pytest.mark.parametrize("shape", [(1, 6), (6, 1), (1, 1)])
def test_an_image_of_a_few_pixels_tells_nothing(shape: tuple[int, int]) -> None:
    departure, slope = np.full(shape, 25, np.float32), np.full((2, *shape), 0.5, np.float32)
    assert told({"departure": departure, "slope": slope, "misfit": np.zeros(5)}).figure == 0


def test_an_untouched_film_is_judged_by_its_rest_alone() -> None:
    level = touch(departs=25.0)
    level["slope"] = 0 * level["slope"]
    assert told(level).figure == pytest.approx(1 / MAX_REST)


@pytest.mark.parametrize(("dimmed", "is_dirt"), [(0.1, False), (0.25, True)])
def test_dirt_on_a_one_shot_sensor_dims_less_without_labels(dimmed: float, is_dirt: bool) -> None:
    """Its colours are smoothed, and its map tells by how much film is darker than its slope."""
    names = "departure", "slope", "misfit", "brighter"
    what = {name: plane for name, plane in touch().items() if name in names}
    what["brighter"][12, 12:20] = -dimmed
    figures = light_evidence(**what, max_dimming=0.2)
    assert (check_light(figures).figure > 1) == is_dirt
