"""Shear of presses whose traction is known."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from rings.mechanics.tests.force.presses import (
    F8,
    MODULUS,
    PEAK,
    PIXEL,
    SHAPE,
    Face,
    distance,
    face,
)
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.nodes.force.drag_to_shear import ShearForce, drag_to_shear
from tactograph.rings.mechanics.nodes.force.press_to_pressure import press_to_pressure

TOTALS = "shear_x_n", "shear_y_n", "torque_n_mm"
MIDDLE = np.array([SHAPE[1] - 1, SHAPE[0] - 1]) / 2
GELS = [(1.5, 0.3), (2.5, 0.48), (4.0, 0.5)]


class Press:
    """A ball that is dragged and turned: it sticks within a share of its contact (Mindlin)."""

    def __init__(self, gel: tuple[float, float], radius: float, angle: float, stuck: float) -> None:
        rows, columns = SHAPE
        size = 2 * rows, 2 * columns  # what repeats is far away
        y, x = PIXEL * (np.indices(size) - np.reshape([rows - 0.5, columns - 0.5], (2, 1, 1)))
        r = np.hypot(x, y)
        ball = PEAK * np.sqrt(np.maximum(1 - (r / radius) ** 2, 0))
        held = stuck * PEAK * np.sqrt(np.maximum(1 - (r / (stuck * radius)) ** 2, 0))
        along, around = 0.5 * (ball - held), 0.2 * ball / radius
        drag = along * np.cos(angle) - y * around, along * np.sin(angle) + x * around
        inner = slice(rows // 2, rows // 2 + rows), slice(columns // 2, columns // 2 + columns)
        self.gel, self.moved = gel, Face(*(u[inner] for u in face(ball, *drag, PIXEL, *gel)))
        self.contact = (r[inner] < 1.1 * radius).astype(np.uint8)
        totals = drag[0].sum(), drag[1].sum(), (x * drag[1] - y * drag[0]).sum()
        self.truth = 1e-3 * PIXEL**2 * np.array(totals)

    def markers(self, rng: np.random.Generator, pitch: float, noise_px: float) -> MarkerTracks:
        y, x = np.mgrid[-5.5:5.6:pitch, -7.5:7.6:pitch]
        rest = np.column_stack([x.ravel(), y.ravel()]) / PIXEL + rng.uniform(-3, 3, 2) + MIDDLE
        now = rest.copy()
        for _ in range(3):
            x, y = (map_coordinates(u, now.T[::-1], order=1) for u in self.moved[1:])
            now = rest + np.column_stack([x, y]) / PIXEL
        shift = now - rest + rng.normal(0, noise_px, rest.shape)
        rows = np.column_stack([rest, np.full(len(rest), 2.0)])
        seen = np.ones(len(rest), np.uint8)
        return MarkerTracks(rows.astype(np.float32), shift.astype(np.float32), seen)

    def found(self, tracks: MarkerTracks, **settings: float) -> ShearForce:
        thickness, poisson = self.gel
        gel = {"modulus_kpa": MODULUS, "thickness_mm": thickness, "poisson": poisson}
        height = self.moved.z.astype(np.float32)
        pressure = press_to_pressure(height, self.contact, PIXEL, **gel).pressure
        args = height, self.contact, pressure, tracks, PIXEL
        return drag_to_shear(*args, **gel, **settings)


def values(found: ShearForce) -> F8:
    return np.array([found.figures[f"contact_{name}/c1"] for name in TOTALS])


def deviations(found: ShearForce) -> F8:
    names = (name.replace("_", "_sd_", 1) for name in TOTALS)
    return np.array([found.figures[f"contact_{name}/c1"] for name in names])


@pytest.mark.parametrize("gel", GELS)
def test_force_and_torque_of_a_ball_that_slips_in_part(gel: tuple[float, float]) -> None:
    press = Press(gel, 1.6, 0.5, 0.5)
    tracks = press.markers(np.random.default_rng(1), 0.5, 0.002)
    found = press.found(tracks, marker_error_px=0.002)
    np.testing.assert_allclose(values(found), press.truth, rtol=0.02)
    assert not found.shear[:, press.contact == 0].any()
    total = 1e-3 * PIXEL**2 * found.shear.sum(axis=(1, 2))
    np.testing.assert_allclose(total, values(found)[:2], rtol=0.01)


def test_a_thick_layer_moves_as_mindlin_says() -> None:
    """Johnson, "Contact Mechanics", 1985, equation 3.91: q0 sqrt(1 - r^2 / a^2) along x."""
    a, q0, poisson, modulus = 2.0, 15.0, 0.4, MODULUS / 2.8
    places = np.mgrid[-2:2.1:0.4, -2:2.1:0.4].reshape(2, -1)
    y, x = places[:, np.hypot(*places) < a]
    scale = np.pi * q0 / (32 * modulus * a)
    way = scale * (4 * (2 - poisson) * a**2 - (4 - 3 * poisson) * x**2 - (4 - poisson) * y**2)
    drag = np.column_stack([way, scale * 2 * poisson * x * y]) / PIXEL
    rest = np.column_stack([x, y]) / PIXEL + MIDDLE
    rows = np.column_stack([rest - drag, np.full(len(x), 2.0)]).astype(np.float32)
    tracks = MarkerTracks(rows, drag.astype(np.float32), np.ones(len(x), np.uint8))
    none, gel = np.zeros(SHAPE, np.float32), {"modulus_kpa": MODULUS, "thickness_mm": 400.0}
    found = drag_to_shear(
        none, (distance() < a).astype(np.uint8), none, tracks, PIXEL, **gel, poisson=poisson,
        marker_error_px=0.01,
    )  # fmt: skip
    force = 1e-3 * q0 * 2 / 3 * np.pi * a**2
    np.testing.assert_allclose(values(found), [force, 0, 0], atol=0.02 * force)


def random_presses() -> tuple[F8, F8]:
    """Of 200 presses: which totals are within 1.645 deviations, and the shear's relative error."""
    rng, inside, off = np.random.default_rng(5), [], []
    for _ in range(200):
        gel = rng.uniform(1.5, 4), rng.uniform(0.4, 0.5)
        press = Press(gel, rng.uniform(1.2, 2.5), rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 0.9))
        found = press.found(press.markers(rng, rng.uniform(0.8, 1.5), 0.05))
        apart = values(found) - press.truth
        inside.append(np.abs(apart) < 1.645 * deviations(found))
        off.append(np.hypot(*apart[:2]) / np.hypot(*press.truth[:2]))
    return np.array(inside), np.array(off)


@pytest.mark.slow
def test_200_presses_have_their_forces_within_the_stated_error() -> None:
    inside, _ = random_presses()
    assert np.all(np.mean(inside, axis=0) > 0.85)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.06)


def test_a_press_without_drag_has_no_shear() -> None:
    """The film flows aside under pressure alone."""
    press = Press((2.0, 0.49), 1.6, 0.0, 0.999)
    ball = PEAK * np.sqrt(np.maximum(1 - (distance() / 1.6) ** 2, 0))
    press.moved = face(ball, 0 * ball, 0 * ball, PIXEL, *press.gel)
    found = press.found(press.markers(np.random.default_rng(2), 1.0, 0.05))
    assert np.all(np.abs(values(found)) < 3 * deviations(found))
    assert deviations(found)[0] < 0.005


def test_a_contact_of_fewer_than_two_markers_has_no_figures() -> None:
    press = Press((2.5, 0.48), 1.6, 0.0, 0.5)
    tracks = press.markers(np.random.default_rng(1), 1.0, 0.05)
    found = press.found(tracks._replace(visible=np.zeros_like(tracks.visible)))
    assert found.figures == {}
    assert not found.shear.any()


@pytest.mark.parametrize("graph", ["reconstruct_markers", "live_markers", "gelsight_mini_markers"])
def test_the_overlay_fits_films_with_markers(graph: str) -> None:
    sheared = with_overlays(read_graph(graph), ["force", "shear"])
    assert "shear" in sheared.nodes[sheared.in_full("figures")].inputs


@pytest.mark.parametrize(
    "graph", ["reconstruct", "live", "replay", "gelsight_mini", "live_oneshot"]
)
def test_a_grip_has_slip_and_forces_under_the_same_numbers(graph: str) -> None:
    grip = with_overlays(read_graph(graph), ["grip"])
    names = {grip.nodes[node].inputs["contact"] for node in ("slip", "force", "shear")}
    assert names == {"follow.contact"}
    assert {"slip", "force", "shear", "pose"} <= {*grip.nodes[grip.in_full("figures")].inputs}
