"""Forces of presses whose pressure is known."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes.force.press_to_pressure import press_to_pressure
from tests.nodes.force.presses import (
    FORCE,
    MODULUS,
    PEAK,
    PIXEL,
    RADIUS,
    SHAPE,
    contact,
    displacement,
    distance,
    height,
    noise,
)

GELS = [(1.5, 0.3), (2.5, 0.45), (2.5, 0.48), (2.5, 0.5)]


def test_a_thick_layer_is_pressed_in_as_hertz_says() -> None:
    r = np.linspace(0, 0.9 * RADIUS, 10)
    poisson = 0.3
    ball = np.pi * PEAK * (1 - poisson**2) / (4 * MODULUS * RADIUS) * (2 * RADIUS**2 - r**2)
    np.testing.assert_allclose(displacement(2000 * RADIUS, poisson, r), ball, rtol=0.01)


@pytest.mark.parametrize(("thickness", "poisson"), GELS)
def test_force_and_pressure_of_a_ball(thickness: float, poisson: float) -> None:
    found = press_to_pressure(
        height(thickness, poisson),
        contact(),
        PIXEL,
        modulus_kpa=MODULUS,
        thickness_mm=thickness,
        poisson=poisson,
    )
    assert found.figures["contact_force_n/c1"] == pytest.approx(FORCE, rel=0.02)
    inner = distance() < 0.8 * RADIUS
    ball = PEAK * np.sqrt(np.maximum(1 - (distance() / RADIUS) ** 2, 0))
    np.testing.assert_allclose(found.pressure[inner], ball[inner], atol=0.05 * PEAK)
    assert found.figures["contact_force_x_px/c1"] == pytest.approx((SHAPE[1] - 1) / 2, abs=0.1)
    assert not found.pressure[contact() == 0].any()


def test_a_wrong_zero_and_tilt_hardly_matter() -> None:
    thickness, poisson = 2.5, 0.48
    tilted = height(thickness, poisson) + np.float32(0.01) + np.float32(2e-4) * np.arange(160)
    settings = {"modulus_kpa": MODULUS, "thickness_mm": thickness, "poisson": poisson}
    found = press_to_pressure(np.float32(tilted), contact(), PIXEL, **settings)
    assert found.figures["contact_force_n/c1"] == pytest.approx(FORCE, rel=0.02)


@pytest.mark.parametrize(("thickness", "poisson"), GELS[1:3])
def test_the_stated_deviation_holds(thickness: float, poisson: float) -> None:
    rng, z, error = np.random.default_rng(3), height(thickness, poisson), 0.004
    settings = {"modulus_kpa": MODULUS, "thickness_mm": thickness, "poisson": poisson}
    stated = np.full(SHAPE, error, np.float32)
    inside = 0
    for _ in range(100):
        seen = (z + noise(rng, error)).astype(np.float32)
        figures = press_to_pressure(seen, contact(), PIXEL, stated, **settings).figures
        off = abs(figures["contact_force_n/c1"] - FORCE)
        inside += off < 1.645 * figures["contact_force_sd_n/c1"]
    assert 84 <= inside <= 98


def test_the_moduluss_error_is_part_of_the_forces() -> None:
    z, stated = height(2.5, 0.48), np.full(SHAPE, 1e-6, np.float32)
    figures = press_to_pressure(
        z, contact(), PIXEL, stated, modulus_kpa=MODULUS, thickness_mm=2.5, modulus_error=0.1
    ).figures
    assert figures["contact_force_sd_n/c1"] == pytest.approx(0.1 * FORCE, rel=0.05)


def test_limits_of_the_model_are_told() -> None:
    everywhere = np.ones(SHAPE, np.uint8)
    with collect_warnings([]) as told:
        press_to_pressure(height(2.5, 0.48), everywhere, PIXEL, modulus_kpa=1, thickness_mm=0.4)
    assert "no longer linear" in told[0]
    assert "reaches the image's border" in told[1]


def test_without_a_contact_there_is_no_pressure() -> None:
    none = np.zeros(SHAPE, np.uint8)
    found = press_to_pressure(height(2.5, 0.48), none, PIXEL, modulus_kpa=1, thickness_mm=2.5)
    assert not found.pressure.any()
    assert found.figures == {}
