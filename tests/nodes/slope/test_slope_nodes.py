"""Shadow test, look-up and refinement on a Lambertian ball whose slopes are known."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tactograph.nodes.calibrate.tables.build_lut import build_lut
from tactograph.nodes.calibrate.tables.fit_null_vector import fit_null_vector
from tactograph.nodes.calibrate.tables.fit_reflectance import fit_reflectance
from tactograph.nodes.calibrate.tables.label_lit import label_lit
from tactograph.nodes.shadow.shadow_linear import shadow_linear
from tactograph.nodes.slope.index_lut import index_lut
from tactograph.nodes.slope.lut_nearest import lut_nearest
from tactograph.nodes.slope.refine_taylor import refine_taylor
from tests.nodes.scenes import ball, lambert

Z, SLOPE = ball(120, 120, 86)
LIGHT = lambert(SLOPE)
MASK = np.ones(Z.shape, np.uint8)
LIT = label_lit(LIGHT)
NULL = fit_null_vector(LIGHT, MASK, LIT).null
FIT = fit_reflectance(LIGHT, SLOPE, MASK, LIT).reflectance
INDEX = index_lut(*build_lut(LIGHT, SLOPE, MASK, LIT))
LABELS = shadow_linear(LIGHT, NULL, 0.002)
SHALLOW = np.float32(0.2) * SLOPE
GENTLE = lambert(SHALLOW)


def test_no_label_where_all_leds_reach() -> None:
    assert not LABELS[LIT == 15].any()


def test_the_shadowed_led_is_found() -> None:
    one_dark = np.bitwise_count(LIT) == 3
    # Close to the terminator the missing light is within the noise.
    missing = np.abs(np.tensordot(NULL, LIGHT, axes=1)) > 0.006
    assert np.array_equal((LABELS == (15 & ~LIT))[one_dark], missing[one_dark])
    assert missing[one_dark].mean() > 0.8


@given(led=st.integers(0, 3), depth=st.floats(0, 0.5))
def test_a_darkened_led_is_labelled(led: int, depth: float) -> None:
    light = lambert(np.zeros((2, 4, 4), np.float32))
    light[led] *= depth
    assert (shadow_linear(light, NULL, 0.002) == 1 << led).all()


def test_every_calibration_pixel_finds_itself() -> None:
    nearest = lut_nearest(LIGHT, np.where(LIT == 15, 0, 15 & ~LIT).astype(np.uint8), INDEX)
    single = np.bitwise_count(LIT) >= 3
    assert np.array_equal(nearest[:, single], SLOPE[:, single])


def test_the_coarse_slope_is_near_and_the_refined_one_exact() -> None:
    none = np.zeros(Z.shape, np.uint8)
    coarse = lut_nearest(GENTLE, none, INDEX)
    fine = refine_taylor(GENTLE, coarse, none, FIT)
    assert np.abs(coarse - SHALLOW).max() < 0.02
    assert np.abs(fine - SHALLOW).max() < 2e-4


@pytest.mark.parametrize("far", [0.0, 3.0])
def test_the_nearest_entry_is_found_exactly_and_one_of_equal_ones(far: float) -> None:
    """A lattice of light, and pixels of which two LEDs are halfway between its entries."""
    rng = np.random.default_rng(2)
    axis = np.arange(5, dtype=np.float32) / 4
    entries = np.stack(np.meshgrid(axis, axis, axis, axis), axis=-1).reshape(-1, 4)
    entries = entries[rng.permutation(len(entries))]
    slopes = rng.uniform(-1, 1, (len(entries), 2)).astype(np.float32)
    index = index_lut(entries, slopes, np.full(len(entries), 15, np.uint8))
    light = (rng.integers(0, 5, (4, 20, 30)) / 4 + far).astype(np.float32)
    light[:2] += np.float32(1 / 8)
    nearest = lut_nearest(light, np.zeros(light.shape[1:], np.uint8), index).reshape(2, -1).T
    away = np.square(light.reshape(4, -1).T[:, None].astype(float) - entries).sum(axis=2)
    mine = (slopes == nearest[:, None]).all(axis=2)
    assert (mine.sum(axis=1) == 1).all()
    assert np.array_equal(away[mine], away.min(axis=1))


def test_shadowed_pixels_are_not_refined() -> None:
    shadow = np.ones(Z.shape, np.uint8)
    assert np.array_equal(refine_taylor(GENTLE, SLOPE, shadow, FIT), SLOPE)


@given(limit=st.floats(0.001, 0.5), offset=st.floats(-0.5, 0.5))
def test_a_step_never_turns_the_normal_further_than_allowed(limit: float, offset: float) -> None:
    start = (SHALLOW + np.float32(offset)).astype(np.float32)
    end = refine_taylor(GENTLE, start, np.zeros(Z.shape, np.uint8), FIT, max_turn_rad=limit)
    change = np.hypot(*(end - start)) / (1 + (start**2).sum(axis=0))
    assert change.max() <= limit * 1.001


@pytest.mark.parametrize("count", [3, 5, 6])
def test_slopes_are_refined_with_any_number_of_leds(count: int) -> None:
    azimuth = np.arange(count) * 2 * np.pi / count
    lights = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.full(count, 0.866)], 1)
    light = lambert(SLOPE, lights.astype(np.float32))
    lit = label_lit(light)
    index = index_lut(*build_lut(light, SLOPE, MASK, lit))
    fit = fit_reflectance(light, SLOPE, MASK, lit).reflectance
    touch = lambert(SHALLOW, lights.astype(np.float32))
    none = np.zeros(Z.shape, np.uint8)
    fine = refine_taylor(touch, lut_nearest(touch, none, index), none, fit)
    assert np.abs(fine - SHALLOW).max() < 1e-3
