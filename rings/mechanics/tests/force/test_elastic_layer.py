"""The layer's answer to tractions, against other ways to find it."""

import numpy as np
import pytest
from scipy.linalg import expm

from rings.mechanics.tests.force.presses import MODULUS, face
from tactograph.rings.mechanics.nodes.force.elastic_layer import layer_compliance
from tactograph.rings.mechanics.nodes.force.press_to_pressure import press_to_pressure


def through_the_layer(k: float, thickness: float, poisson: float) -> np.ndarray:
    """Along, coupled; coupled, normal: elasticity integrated from the window to the face."""
    shear = 0.5 / (1 + poisson)
    lame = 2 * shear * poisson / (1 - 2 * poisson)
    stiff = lame + 2 * shear
    # Of u and w, and of the tractions s and t on a plane, u e^(ikx) and i w e^(ikx).
    slope = np.array(
        [
            [0, k, 1 / shear, 0],
            [-k * lame / stiff, 0, 0, 1 / stiff],
            [k * k * (stiff - lame**2 / stiff), 0, 0, k * lame / stiff],
            [0, 0, -k, 0],
        ]
    )
    whole = expm(thickness * slope)
    return np.asarray(whole[:2, 2:] @ np.linalg.inv(whole[2:, 2:]))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.48])
@pytest.mark.parametrize("kh", [0.05, 0.7, 2.0, 6.0])
def test_the_closed_form_agrees_with_elasticity(poisson: float, kh: float) -> None:
    thickness = 2.5
    answer = layer_compliance(np.array([kh / thickness]), thickness, poisson)
    found = through_the_layer(kh / thickness, thickness, poisson)
    stated = [[answer.along[0], answer.coupled[0]], [answer.coupled[0], answer.normal[0]]]
    np.testing.assert_allclose(found, stated, rtol=1e-6)
    across = 2 * (1 + poisson) * np.tanh(kh) * thickness / kh
    assert answer.across == pytest.approx(across)


def test_a_thin_layer_is_squeezed_and_sheared_as_a_whole() -> None:
    poisson, thickness = 0.3, 0.02
    answer = layer_compliance(np.array([0.1]), thickness, poisson)
    squeezed = thickness * (1 + poisson) * (1 - 2 * poisson) / (1 - poisson)
    assert answer.normal == pytest.approx(squeezed, rel=1e-3)
    for sheared in (answer.along, answer.across):
        assert sheared == pytest.approx(2 * (1 + poisson) * thickness, rel=1e-3)


def test_a_layer_that_cannot_be_compressed_only_flows_aside() -> None:
    k, thickness = np.array([0.02]), 2.0
    aside = thickness * (k * thickness) ** 2
    assert layer_compliance(k, thickness, 0.5).normal == pytest.approx(aside, rel=1e-2)


@pytest.mark.slow
def test_another_solver_gives_the_same_displacement_of_a_half_space() -> None:
    """All nine numbers of the compliance, with `tamaas`; its means are zero."""
    tamaas = pytest.importorskip("tamaas", reason="'make test-all' installs it on Linux")
    pixel, poisson = 0.1, 0.35
    y, x = pixel * (np.indices((64, 64)) - 32)
    pressure = 40 * np.sqrt(np.maximum(1 - ((x - 0.2) ** 2 + y**2) / 1.44, 0))
    drag = 0.3 * pressure, (0.1 * x - 0.2) * pressure
    model = tamaas.Model(tamaas.model_type.surface_2d, [6.4, 6.4], [64, 64])
    model.E, model.nu = MODULUS, poisson
    model.traction[:] = np.stack([drag[1], drag[0], pressure], axis=-1)  # rows before columns
    model.solveNeumann()
    found = face(pressure, *drag, pixel, 1e4, poisson)
    for mine, axis in zip(found, (2, 1, 0), strict=True):
        other = model.displacement[..., axis]
        np.testing.assert_allclose(mine - mine.mean(), other, atol=1e-3 * np.abs(other).max())


@pytest.mark.slow
def test_another_solver_presses_a_ball_with_the_same_force() -> None:
    """`tamaas` finds where a ball touches, and how it presses."""
    tamaas = pytest.importorskip("tamaas", reason="'make test-all' installs it on Linux")
    pixel, size, load_kpa = 0.05, 256, 1.2
    y, x = pixel * (np.indices((size, size)) - size / 2)
    model = tamaas.Model(tamaas.model_type.basic_2d, [size * pixel] * 2, [size, size])
    model.E, model.nu = MODULUS, 0.48
    tamaas.PolonskyKeerRey(model, -(x**2 + y**2) / (2 * 5.0), 1e-8).solve(load_kpa)
    pressed = np.asarray(model.displacement)
    found = press_to_pressure(
        (pressed - pressed[0].mean()).astype(np.float32),
        (np.asarray(model.traction) > 0).astype(np.uint8),
        pixel,
        modulus_kpa=MODULUS,
        thickness_mm=1e3,
    )
    force_n = 1e-3 * load_kpa * (size * pixel) ** 2
    assert found.figures["contact_force_n/c1"] == pytest.approx(force_n, rel=0.02)
    assert found.figures["contact_pressure_kpa/c1"] == pytest.approx(model.traction.max(), rel=0.02)
