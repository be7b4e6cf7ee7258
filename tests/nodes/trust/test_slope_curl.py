"""Slopes of a surface do not curl; slopes that no surface has do."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.nodes import F4
from tactograph.nodes.trust.checked_cells import NOT_TESTED
from tactograph.nodes.trust.slope_curl import slope_curl
from tactograph.nodes.trust.touch_evidence import curl_evidence
from tests.nodes.scenes import ball

SHAPE = (60, 80)
EXACT = np.zeros(5, np.float32)
ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)


@st.composite
def smooth_slopes(draw: st.DrawFn) -> F4:
    """The gradient of some waves, eight cells of 4 px long or more, in all directions."""
    slope = np.zeros((2, *SHAPE))
    for _ in range(draw(st.integers(1, 4))):
        steepness = draw(st.floats(0.05, 0.4))
        length, azimuth = draw(st.floats(32, 200)), draw(st.floats(0, 2 * np.pi))
        phase = draw(st.floats(0, 2 * np.pi))
        along = np.array([np.cos(azimuth), np.sin(azimuth)])
        place = along[0] * COLUMN + along[1] * ROW
        rise = steepness * np.cos(2 * np.pi * place / length + phase)
        slope += along[:, None, None] * rise
    return slope.astype(np.float32)


def where_tested(curl: F4) -> F4:
    return curl[curl >= 0]


@settings(max_examples=60)
@given(smooth_slopes(), st.sampled_from([1, 2, 4]))
def test_a_smooth_surface_does_not_curl(slope: F4, factor: int) -> None:
    found = slope_curl(slope, EXACT, factor=factor)
    assert np.isfinite(found).all()
    # One cell may: where the slope's change vanishes, and the change of that does not.
    assert curl_evidence(found) < 0.5


def cap() -> F4:
    return ball(*SHAPE, radius=60.0)[1]


def test_a_cap_of_a_ball_does_not_curl_nor_does_one_turned() -> None:
    found = where_tested(slope_curl(cap(), EXACT, factor=4))
    assert found.size > 200
    assert found.max() < 0.5
    turned = cap()[:, ::-1, ::-1]
    assert where_tested(slope_curl(turned, EXACT)).max() < 0.5, "they need another check"


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (lambda slope: slope[::-1], "LEDs of two axes swapped"),
        (lambda slope: slope[:, :, ::-1], "images mirrored"),
        (lambda slope: slope * np.array([1, -1], np.float32)[:, None, None], "one axis reversed"),
        (lambda slope: np.stack([slope[0], np.roll(slope[1], 30, axis=1)]), "of another touch"),
    ],
    ids=["swapped", "mirrored", "reversed", "another touch"],
)
def test_slopes_of_wrong_images_curl(wrong: object, what: str) -> None:
    slope = np.stack([0.3 * np.cos(COLUMN / 9 + ROW / 6), 0.45 * np.cos(COLUMN / 9 + ROW / 6)])
    right = slope.astype(np.float32)
    assert where_tested(slope_curl(right, EXACT)).max() < 0.5
    assert np.median(where_tested(slope_curl(wrong(right), EXACT))) > 4, what  # type: ignore[operator]


def test_a_frame_that_ends_with_other_images_is_found() -> None:
    torn = cap()
    torn[:, 48:] = np.stack([torn[1, 48:], -torn[0, 48:]])
    found = (slope_curl(slope, EXACT, factor=2) for slope in (cap(), torn))
    whole, band = (curl_evidence(curl) for curl in found)
    assert whole < 0.3
    assert band > 1


@pytest.mark.parametrize("noise", [0.003, 0.02])
@pytest.mark.parametrize(("factor", "cell_px"), [(1, 1), (4, 1), (2, 3)])
def test_stated_noise_is_not_taken_for_curl(noise: float, factor: int, cell_px: int) -> None:
    """Of a tilted plane; the noise is that of a pixel of the camera."""
    rng = np.random.default_rng(1)
    slope = 0.3 + rng.normal(0, noise / cell_px, (2, 120, 160)).astype(np.float32)
    variance = np.full(slope.shape, noise * noise, np.float32)
    given = {"factor": factor, "cell_px": cell_px, "least": 1e-6}
    stated = where_tested(slope_curl(slope, EXACT, variance=variance, **given)).mean()
    assert 0.8 < stated <= 1.05
    assert where_tested(slope_curl(slope, EXACT, **given)).mean() > 5 * stated


def test_the_calibrations_misfit_raises_the_expected_curl() -> None:
    slope = 0.3 + np.random.default_rng(1).normal(0, 0.01, (2, *SHAPE)).astype(np.float32)
    loose = np.array([0.05, 1, 0, 0, 0], np.float32)
    exact, wide = (where_tested(slope_curl(slope, misfit)).mean() for misfit in (EXACT, loose))
    assert wide < 0.1 < exact


def test_level_film_tests_nothing() -> None:
    level = np.random.default_rng(1).normal(0, 0.01, (2, *SHAPE)).astype(np.float32)
    assert (slope_curl(level, EXACT) == NOT_TESTED).all()


def test_pairs_of_leds_test_nothing_and_edges_do() -> None:
    slope = np.full((2, 12, 16), 0.2, np.float32)
    slope[0, :, 8:] = -0.6  # a ridge between columns 7 and 8
    used = np.full((12, 16), 0b1111, np.uint8)
    used[6:] = 0b0110
    expected = np.zeros((12, 16), np.float32)
    expected[5:] = NOT_TESTED
    expected[-1] = expected[:, -1] = NOT_TESTED
    np.testing.assert_array_equal(slope_curl(slope, EXACT, used), expected)


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1), (4, 4)])
def test_fewer_than_four_cells_test_nothing(shape: tuple[int, int]) -> None:
    slope = np.full((2, *shape), 0.3, np.float32)
    found = slope_curl(slope, EXACT, factor=4)
    assert found.shape == tuple(-(-side // 4) for side in shape)
    assert (found == NOT_TESTED).all()
