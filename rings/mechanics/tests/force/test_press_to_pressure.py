"""Forces of presses whose pressure is known."""

import cv2
import numpy as np
import pytest

from rings.mechanics.tests.force.presses import (
    FORCE,
    MODULUS,
    PEAK,
    PIXEL,
    RADIUS,
    SHAPE,
    contact,
    displaced,
    distance,
    height,
    noise,
)
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F8, U1
from tactograph.nodes.contact.find_contact import find_contact
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.optics.camera_view import View
from tactograph.rings.mechanics.nodes.force.press_to_pressure import PressForce, press_to_pressure
from tests.nodes.contact.test_largest_contacts import CONTACT, HEIGHT, MAX_MEASURED, SMALL

Gel = tuple[float, float]
GELS = [(1.5, 0.3), (2.5, 0.45), (2.5, 0.48), (2.5, 0.5)]


def test_a_thick_layer_is_pressed_in_as_hertz_says() -> None:
    r = np.linspace(0, 0.9 * RADIUS, 10)
    poisson = 0.3
    ball = np.pi * PEAK * (1 - poisson**2) / (4 * MODULUS * RADIUS) * (2 * RADIUS**2 - r**2)
    np.testing.assert_allclose(displaced(2000 * RADIUS, poisson, r)[0], ball, rtol=0.01)


def found(
    z: F8, contact: U1, error: float | None = None, gel: Gel = GELS[2], **settings: float
) -> PressForce:
    """Pressure of a height with a stated error."""
    settings = {"modulus_kpa": MODULUS, "thickness_mm": gel[0], "poisson": gel[1], **settings}
    stated = None if error is None else np.full(SHAPE, error, np.float32)
    return press_to_pressure(z.astype(np.float32), contact, PIXEL, stated, **settings)


@pytest.mark.parametrize("gel", GELS)
def test_force_and_pressure_of_a_ball(gel: Gel) -> None:
    result = found(height(*gel), contact(), gel=gel)
    assert result.figures["contact_force_n/c1"] == pytest.approx(FORCE, rel=0.02)
    inner = distance() < 0.8 * RADIUS
    ball = PEAK * np.sqrt(np.maximum(1 - (distance() / RADIUS) ** 2, 0))
    np.testing.assert_allclose(result.pressure[inner], ball[inner], atol=0.05 * PEAK)
    assert result.figures["contact_force_x_px/c1"] == pytest.approx((SHAPE[1] - 1) / 2, abs=0.1)
    assert not result.pressure[contact() == 0].any()


def test_a_lens_and_a_near_camera_leave_force_and_pressure() -> None:
    """The same press, as the film is and as a camera sees it."""
    lens = np.array([-0.1, 0.02, 0, 0, 0.03, 0, 0, 0], np.float32)
    view, film = View(lens, 1 / 30), height(*GELS[2])
    # Each pixel sees the point that the even grid, brought back, has there.
    seen = film
    for _ in range(20):
        x, y = View(lens, 1 / 30).places(seen)
        column, row = (p + (s - 1) / 2 for p, s in zip((x, y), SHAPE[::-1], strict=True))
        seen = cv2.remap(film, column.astype(np.float32), row.astype(np.float32), cv2.INTER_CUBIC)
    reach = np.hypot(x, y) * PIXEL
    settings = {"modulus_kpa": MODULUS, "thickness_mm": GELS[2][0], "poisson": GELS[2][1]}
    touched = (reach < 1.2 * RADIUS).astype(np.uint8)
    error = np.full(SHAPE, 0.005, np.float32)
    result = press_to_pressure(seen, touched, PIXEL, error, view, **settings)
    plain = found(film, contact(), 0.005)
    # The edge that a deviation knows of is a cell of the image, here 3 % more than one of the film.
    for name, within in ("force_n", 0.02), ("force_sd_n", 0.03), ("pressure_kpa", 0.02):
        key = f"contact_{name}/c1"
        assert result.figures[key] == pytest.approx(plain.figures[key], rel=within)
    inner = reach < 0.8 * RADIUS
    ball = PEAK * np.sqrt(np.maximum(1 - (reach / RADIUS) ** 2, 0))
    np.testing.assert_allclose(result.pressure[inner], ball[inner], atol=0.06 * PEAK)


def test_a_wrong_zero_and_tilt_hardly_matter() -> None:
    result = found(height(*GELS[2]) + 0.01 + 2e-4 * np.arange(160), contact())
    assert result.figures["contact_force_n/c1"] == pytest.approx(FORCE, rel=0.02)


@pytest.mark.parametrize("gel", [(2.5, 0.48), (4.0, 0.48), (8.0, 0.48)])
def test_film_that_is_held_at_rest_pulls_at_nothing(gel: Gel) -> None:
    """A sensor sees no slope of film that is nearly at rest, which hangs beside the object."""
    z = height(*gel)
    slope = np.stack(np.gradient(z, PIXEL)[::-1]) * (distance() < 2.5 * RADIUS)
    seen = integrate_dct(slope.astype(np.float32), PIXEL)
    seen -= np.median(seen[[0, -1]])
    figures = found(seen, (distance() < 2 * RADIUS).astype(np.uint8), 1e-6, gel).figures
    off = figures["contact_force_n/c1"] - FORCE
    assert abs(off) < 0.03 * FORCE
    assert abs(off) < 2 * figures["contact_force_sd_n/c1"]


@pytest.mark.parametrize("gel", GELS[1:3])
def test_the_stated_deviation_holds(gel: Gel) -> None:
    rng, z, error, inside = np.random.default_rng(3), height(*gel), 0.004, 0
    for _ in range(100):
        figures = found(z + noise(rng, error), contact(), error, gel).figures
        off = abs(figures["contact_force_n/c1"] - FORCE)
        inside += off < 1.645 * figures["contact_force_sd_n/c1"]
    assert inside >= 84


@pytest.mark.slow
def test_the_deviation_holds_of_contacts_as_they_are_found() -> None:
    """Thin gels bulge, so that a contact is found too small; thick ones feel the frame."""
    rng, held, shares = np.random.default_rng(0), [], []
    for gel in ((1.0, 0.48), (1.5, 0.5), (2.5, 0.48), (4.0, 0.48), (8.0, 0.48)):
        for radius in (0.8, 1.6, 2.4):
            z = height(*gel, radius) + noise(rng, 0.001)
            figures = found(z, find_contact(z.astype(np.float32)), 0.001, gel).figures
            force, sd = (figures[f"contact_force_{each}/c1"] for each in ("n", "sd_n"))
            held.append(abs(force - FORCE * (radius / RADIUS) ** 2) < 1.645 * sd)
            shares.append(sd / force)
    assert np.mean(held) >= 0.8
    assert np.median(shares) < 0.05


def test_the_moduluss_error_is_part_of_the_forces() -> None:
    figures = found(height(*GELS[2]), contact(), 1e-6, modulus_error=0.1).figures
    assert figures["contact_force_sd_n/c1"] == pytest.approx(0.1 * FORCE, rel=0.05)


def test_the_models_limits_give_warnings() -> None:
    with collect_warnings([]) as messages:
        found(height(*GELS[2]), np.ones(SHAPE, np.uint8), thickness_mm=0.4)
    assert "no longer linear" in messages[0]
    assert "reaches the image's border" in messages[1]
    with collect_warnings([]) as messages:
        found(height(*GELS[2]), contact(), thickness_mm=0.05)
    assert "but the gel is 0.05 mm thick" in messages[0]


def test_without_a_contact_there_is_no_pressure() -> None:
    none = found(height(*GELS[2]), np.zeros(SHAPE, np.uint8))
    assert not none.pressure.any()
    assert none.figures == {}


def test_all_contacts_press_but_only_the_largest_have_figures() -> None:
    gel = {"modulus_kpa": 100.0, "thickness_mm": 3.0}
    pressed = press_to_pressure(HEIGHT, CONTACT, 0.1, np.full_like(HEIGHT, 1e-3), **gel)
    assert np.all(pressed.pressure[SMALL[0] == CONTACT] != 0)
    assert len({name.rpartition("/")[2] for name in pressed.figures}) == MAX_MEASURED
