"""Markers that are printed on a simulated film, pressed and dragged by a millimetre."""

from functools import cache

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.render import render
from tactograph.rings.mechanics.nodes.marker.bare_film import bare_film
from tactograph.rings.mechanics.nodes.marker.fill_masked import fill_masked
from tactograph.rings.mechanics.nodes.marker.find_markers import find_markers
from tactograph.rings.mechanics.nodes.marker.marker_darkness import marker_darkness
from tactograph.rings.mechanics.nodes.marker.print_markers import print_markers
from tactograph.rings.mechanics.nodes.marker.track_markers import Tracks, track_markers
from tests.nodes.gels import FLASHED

ROWS, COLUMNS, PIXEL_MM = 240, 320, 0.0634
Y, X = (np.indices((ROWS, COLUMNS)) - np.array([119.5, 159.5])[:, None, None]) * PIXEL_MM
DOTS = {"pitch_mm": 1.5, "radius_mm": 0.25}
DASHES = {"pitch_mm": 1.8, "radius_mm": 0.15, "dash_mm": 0.4}
REACH_MM, WIDTH_PX = 4.0, 15


def ball(x: float, y: float, radius: float, depth: float) -> F4:
    below = np.sqrt(np.maximum(radius**2 - (X - x) ** 2 - (Y - y) ** 2, 0))
    return np.maximum(below - (radius - depth), 0).astype(np.float32)


def lit(height: F4) -> F4:
    return 0.7 * render(height, PIXEL_MM, FLASHED).light


@cache
def level() -> F4:
    return lit(np.zeros((ROWS, COLUMNS), np.float32))


@cache
def pressed() -> F4:
    return lit(press(ball(0.5, -0.3, 4.0, 1.0), PIXEL_MM))


def seen(light: F4, seed: int = 1, **changed: float) -> F4:
    """What the camera sees of a film with markers: noise, and 8 bit."""
    printed = print_markers(light, PIXEL_MM, **{**DOTS, "drag_x_mm": 0.0, **changed})
    noise = 0.004 * np.sqrt(printed) * np.random.default_rng(seed).normal(size=printed.shape)
    return (np.round((printed + noise).clip(0, 1) * 255) / 255).astype(np.float32)


def true_shifts(markers: F4, drag: tuple[float, float]) -> F4:
    """By how many px each marker moves that was at a place: P = G + u(P)."""
    at = (markers[:, :2] - [(COLUMNS - 1) / 2, (ROWS - 1) / 2]) * PIXEL_MM
    now = at.astype(float)
    for _ in range(200):
        near = np.exp(-np.square(now).sum(axis=1) / (2 * REACH_MM**2))
        now = at + near[:, None] * np.asarray(drag)
    return (now - at) / PIXEL_MM


def darkness(light: F4) -> F4:
    return marker_darkness(light, width_px=WIDTH_PX)


def tracked(light: F4, markers: F4, before: F4 | None = None) -> Tracks:
    return track_markers(darkness(light), markers, PIXEL_MM, before)


@pytest.mark.parametrize("print_", [DOTS, DASHES], ids=["dots", "dashes"])
def test_markers_of_the_untouched_film_are_found_where_they_are(print_: dict[str, float]) -> None:
    markers = find_markers(darkness(seen(level(), **print_)))
    pitch = print_["pitch_mm"] / PIXEL_MM
    off = (markers[:, :2] - [(COLUMNS - 1) / 2, (ROWS - 1) / 2] + pitch / 2) % pitch - pitch / 2
    assert len(markers) >= (COLUMNS // pitch - 1) * (ROWS // pitch - 1)
    assert np.abs(off).max() < 0.2


@pytest.mark.parametrize("print_", [DOTS, DASHES], ids=["dots", "dashes"])
@pytest.mark.parametrize("drag", [(1.0, 0.0), (-0.7, 0.7)])
def test_markers_are_followed_through_a_press_and_a_shear(
    print_: dict[str, float], drag: tuple[float, float]
) -> None:
    """Of a millimetre: 95 % are followed, each to 0.2 px."""
    markers = find_markers(darkness(seen(level(), **print_)))
    moved = {"drag_x_mm": drag[0], "drag_y_mm": drag[1], "reach_mm": REACH_MM}
    found = tracked(seen(pressed(), seed=2, **print_, **moved), markers)
    error = np.abs(found.tracks.shift - true_shifts(markers, drag)).max(axis=1)
    followed = (found.tracks.visible > 0) & (error < 0.5)
    assert followed.mean() >= 0.95
    assert np.sqrt(np.square(error[followed]).mean()) < 0.2
    assert found.quality["marker_shift_mm"] == pytest.approx(0.99, abs=0.1)


def test_in_a_stream_the_shifts_before_carry_on() -> None:
    """All of the film moves by more than half a pitch, step by step."""
    markers = find_markers(darkness(seen(level())))
    before = None
    for step in (0.3, 0.6, 0.9, 1.2):
        light = seen(level(), seed=3, drag_x_mm=step, reach_mm=1e3)
        before = tracked(light, markers, before).tracks.shift
    assert np.median(before[:, 0]) == pytest.approx(1.2 / PIXEL_MM, abs=0.2)


def test_a_film_without_markers_has_none() -> None:
    light = (np.round(level() * 255) / 255).astype(np.float32)
    assert len(find_markers(darkness(light))) == 0
    assert bare_film(darkness(light)).all()
    # The rim of a ball was filled in as if it were a marker: 3.4 mm of 5.
    with pytest.raises(InputError, match=r"no markers; for such a film .* marker_px"):
        track_markers(darkness(light), np.zeros((0, 3), np.float32), PIXEL_MM)


def test_a_marker_is_filled_with_the_light_of_the_film_around_it() -> None:
    light = seen(level())
    bare = bare_film(darkness(light), grow_px=2)
    assert 0.7 < bare.mean() < 0.95
    filled = fill_masked(light, bare)
    assert np.abs(filled - level()).max() < 0.04
    np.testing.assert_array_equal(filled[:, bare > 0], light[:, bare > 0])
