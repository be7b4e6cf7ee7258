"""A contact is found where the film is touched, and nowhere else."""

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import Height
from tactograph.nodes.contact.find_contact import find_contact
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.height.rest_at_border import rest_at_border

PIXEL = 0.05
SHAPE = (48, 64)


def noise(rng: np.random.Generator, slope: float = 0.01, smooth: float = 0.0) -> Height:
    """The height of the film at rest: the integral of slopes that are noise."""
    made = rng.normal(0, slope, (2, *SHAPE)).astype(np.float32)
    if smooth:
        made = np.stack([cv2.GaussianBlur(plane, (0, 0), smooth) for plane in made])
    return np.asarray(rest_at_border(integrate_dct(made, PIXEL)))


def bump(x: float, y: float, radius: float, top: float) -> Height:
    """A paraboloid of a height in mm, over a disk of a radius in px."""
    rows, columns = np.indices(SHAPE)
    away = np.hypot(columns - x, rows - y) / radius
    return (top * np.maximum(1 - away**2, 0)).astype(np.float32)


@pytest.mark.parametrize("smooth", [0.0, 1.0])
def test_a_thousand_noisy_frames_of_untouched_film_hold_no_contact(smooth: float) -> None:
    rng = np.random.default_rng(7)
    assert not sum(find_contact(noise(rng, smooth=smooth)).any() for _ in range(1000))


def test_a_touch_is_found_in_that_noise() -> None:
    rng = np.random.default_rng(8)
    for _ in range(20):
        found = find_contact(noise(rng) + bump(30, 22, 10, 0.06))
        assert found.max() == 1
        assert found[22, 30] == 1
        assert not found[:8].any()


def test_the_noise_comes_from_the_film_at_rest_however_large_the_touch() -> None:
    grain = noise(np.random.default_rng(9), 0.001)
    found = find_contact(grain + bump(31.5, 23.5, 30, 0.5))
    assert found.mean() == pytest.approx(0.82, abs=0.06)


def test_two_touches_are_two_contacts_the_larger_first() -> None:
    found = find_contact(bump(14, 20, 8, 0.2) + bump(44, 24, 12, 0.2))
    assert found[20, 14] == 2
    assert found[24, 44] == 1
    assert set(np.unique(found)) == {0, 1, 2}


def test_a_contact_extends_down_to_leave_if_it_reaches_enter() -> None:
    error = np.full(SHAPE, 0.01, np.float32)
    low, high = bump(14, 20, 8, 0.09), bump(44, 24, 12, 0.3)
    found = find_contact(low + high, error)
    assert np.array_equal(found > 0, high > np.float32(0.04))


def test_film_of_unknown_height_is_no_contact() -> None:
    height = bump(30, 22, 12, 0.2)
    error = np.full(SHAPE, 0.001, np.float32)
    error[:, 30:] = 0.1
    found = find_contact(height, error)
    assert found[22, 25] == 1
    assert not found[:, 30:].any()


def test_specks_are_no_contact_nor_is_level_film() -> None:
    height = np.zeros(SHAPE, np.float32)
    assert not find_contact(height).any()
    with pytest.raises(InputError, match="`leave`=11 is above `enter`=10"):
        find_contact(height, leave=11.0)
    height[10:13, 10:16] = 0.5
    assert not find_contact(height).any()
    assert find_contact(height, least_px=18).sum() == 18


def test_a_warning_names_contacts_that_cannot_be_numbered() -> None:
    height = bump(12, 24, 8, 0.2) + bump(31, 24, 9, 0.2) + bump(50, 24, 7, 0.2)
    with collect_warnings([]) as notes:
        found = find_contact(height, most=2)
    assert (found[24, 31], found[24, 12], found[24, 50]) == (1, 2, 0)
    (note,) = notes
    assert note.startswith("3 contacts; the 2 largest are numbered (`most`")


def test_a_pin_within_a_ring_is_a_separate_contact() -> None:
    ring = bump(31, 23, 20, 0.4) - 2 * bump(31, 23, 15, 0.4)
    found = find_contact(np.maximum(ring, 0) + bump(31, 23, 5, 0.2))
    assert found.max() == 2
    assert found[23, 31] == 2
    assert found[23, 15] == found[23, 47] == 1


def test_cores_that_share_their_skirt_are_one_contact() -> None:
    error = np.full(SHAPE, 0.01, np.float32)
    found = find_contact(bump(22, 23, 14, 0.2) + bump(42, 23, 14, 0.2), error)
    assert found.max() == 1
    assert found[23, 22] == found[23, 42] == 1
