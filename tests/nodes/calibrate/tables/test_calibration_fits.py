"""Tables, reflectance and null vector of an ideal Lambertian ball."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.calibrate.tables.build_lut import build_lut
from tactograph.nodes.calibrate.tables.fit_null_vector import fit_null_vector
from tactograph.nodes.calibrate.tables.fit_reflectance import fit_reflectance
from tactograph.nodes.calibrate.tables.label_lit import label_lit
from tactograph.nodes.optics.gauss_newton import SlopeNormal
from tests.nodes.scenes import LIGHTS, ball, lambert

Z, SLOPE = ball(120, 120, 86)
LIGHT = lambert(SLOPE)
MASK = np.ones(Z.shape, np.uint8)
LIT = label_lit(LIGHT)


def test_the_scene_has_attached_shadows() -> None:
    assert 0.5 < (LIT == 15).mean() < 0.99


def test_a_pixel_is_lit_by_the_leds_that_give_it_light() -> None:
    for k in range(4):
        assert np.array_equal((LIT >> k) & 1, LIGHT[k] > 0.01)


def test_the_null_vector_is_orthogonal_to_the_light_directions() -> None:
    fit = fit_null_vector(LIGHT, MASK, LIT)
    assert np.abs(fit.null @ LIGHTS).max() < 1e-5
    assert np.linalg.norm(fit.null) == pytest.approx(1, abs=1e-6)


def test_the_spread_is_that_of_the_noise() -> None:
    rng = np.random.default_rng(1)
    noisy = LIGHT + rng.normal(0, 0.01, LIGHT.shape).astype(np.float32)
    assert fit_null_vector(noisy, MASK, LIT).spread == pytest.approx(0.01, rel=0.05)


def test_black_pixels_would_spoil_the_null_vector() -> None:
    one_side = MASK.copy()
    one_side[:, :60] = 0
    everything = np.full_like(LIT, 15)
    right = fit_null_vector(LIGHT, one_side, LIT)
    wrong = fit_null_vector(LIGHT, one_side, everything)
    assert np.abs(right.null @ LIGHTS).max() < 1e-5
    assert np.abs(wrong.null @ LIGHTS).max() > 1e-3


def test_three_leds_have_no_null_vector() -> None:
    fit = fit_null_vector(LIGHT[:3], MASK, LIT & 7)
    assert not fit.null.any()


def test_lambert_is_of_first_order_in_the_normal() -> None:
    fit = fit_reflectance(LIGHT, SLOPE, MASK, LIT)
    assert np.allclose(fit.reflectance[:, 1:4], LIGHTS, atol=1e-4)
    assert np.abs(np.delete(fit.reflectance, [1, 2, 3], axis=1)).max() < 1e-4
    assert fit.residual.max() < 1e-5


def test_hot_pixels_do_not_spoil_the_residual() -> None:
    rng = np.random.default_rng(1)
    light = LIGHT + rng.normal(0, 0.01, LIGHT.shape).astype(np.float32)
    light[:, rng.random(LIGHT.shape[1:]) < 0.0005] = 4
    fit = fit_reflectance(light, SLOPE, MASK, LIT)
    assert fit.residual == pytest.approx(np.full(4, 0.01), rel=0.1)


def test_harmonics_of_the_film_at_rest() -> None:
    assert SlopeNormal(*np.zeros((2, 1))).harmonics[:, 0].tolist() == [1, 0, 0, 1, 0, 0, 0, 0, 2]


def test_the_tables_without_one_led_reach_further_than_the_full_one() -> None:
    lut = build_lut(LIGHT, SLOPE, MASK, LIT)
    full = lut.lit == 15
    steep = np.hypot(*lut.slope.T)
    assert steep[~full].max() > steep[full].max()
    assert ((lut.lit == 15).sum(), len(lut.lit)) == (
        (LIT == 15).sum(),
        (np.bitwise_count(LIT) >= 3).sum(),
    )


@pytest.mark.parametrize(
    ("node", "arguments"),
    [
        (build_lut, (LIGHT, SLOPE, 0 * MASK, LIT)),
        (fit_reflectance, (LIGHT, SLOPE, 0 * MASK, LIT)),
        (fit_null_vector, (LIGHT, 0 * MASK, LIT)),
    ],
)
def test_too_few_pixels_are_refused(node, arguments) -> None:
    with pytest.raises(InputError, match="100 are needed"):
        node(*arguments)
