"""The light of a touch as a whole, from its pixels' departures."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.touch_evidence import TouchFigures, touch_evidence

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
        "brighter": plane(0),
        "used": plane(ALL, used).astype(np.uint8), "matt": matt, "shadow": shadow,
    }  # fmt: skip


def told(what: Touch, **given: float) -> TouchFigures:
    shape = what["departure"].shape
    curl, light, height = (np.zeros(size, np.float32) for size in (shape, (4, *shape), shape))
    return touch_evidence(curl, light, height, **what, **given).read()  # type: ignore[arg-type]


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


@pytest.mark.parametrize(("width", "is_compared"), [(2, False), (3, False), (7, True)])
def test_walls_a_few_cells_wide_are_not_compared(width: int, is_compared: bool) -> None:
    found = told(walls(width))
    assert (found.of_touch > 4, found.brighter < -0.02) == (is_compared, is_compared)


def test_the_light_of_touch_and_rest_is_told_apart() -> None:
    found = told(touch(departs=16.0, at_rest=4.0))
    assert (found.of_touch, found.at_rest) == pytest.approx((4, 2))
    known = ("departure", "slope")
    assert told({name: touch()[name] for name in known}).of_touch == 1, "labels may be missing"


def test_a_quarter_that_is_wrong_is_seen_by_the_quartile() -> None:
    what = touch()
    what["departure"] = plane(0.5)
    what["departure"][10:13, 10:30] = 25.0
    assert told(what).of_touch == pytest.approx(5)


def test_light_in_shadow_is_seen_where_enough_cells_are_in_it() -> None:
    assert told(touch(lit=0.5, dark=19)).dim == 0
    assert told(touch(lit=0.03, dark=200)).dim == pytest.approx(0.03)


@pytest.mark.parametrize("share", [0.02, -0.02])
def test_touched_film_is_as_bright_as_its_slopes_say(share: float) -> None:
    assert told(darker(share)).brighter == pytest.approx(-share)
    assert told(darker(share, used=0b0101)).brighter == 0, "two LEDs tell no brightness"


def test_film_that_all_leds_leave_dark_is_dirt() -> None:
    what = darker(0.0)
    what["brighter"][12, 12:20] = -0.5
    assert told(what).dirty == 8
    what["brighter"][12, 12:20] = -0.25
    assert told(what).dirty == 0
    assert told(what, max_dimming=0.2).dirty == 8, "one-shot sensors' colours are smoothed"


def test_images_that_are_alike_are_film_that_is_dark_without_a_slope() -> None:
    alike = touch() | {"matt": np.stack([plane(1, 0.7)] * 4), "brighter": plane(0, -0.3)}
    alike["slope"] = 0 * alike["slope"]
    assert told(alike).brighter == pytest.approx(-0.3)


@pytest.mark.parametrize("shape", [(1, 6), (6, 1), (1, 1)])
def test_an_image_of_a_few_pixels_gives_no_evidence(shape: tuple[int, int]) -> None:
    departure, slope = np.full(shape, 25, np.float32), np.full((2, *shape), 0.5, np.float32)
    found = told({"departure": departure, "slope": slope})
    assert found.of_touch == found.at_rest == 0


def test_an_untouched_film_is_judged_by_its_rest_alone() -> None:
    level = touch(departs=25.0)
    level["slope"] = 0 * level["slope"]
    assert told(level).at_rest == 1
    assert told(level).of_touch == 0
