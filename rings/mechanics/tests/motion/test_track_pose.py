"""Poses of objects that move by known steps."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from rings.mechanics.tests.motion.moved_objects import (
    F8,
    PIXEL,
    SHAPE,
    STATED,
    Shape,
    ball,
    coin,
    cylinder,
    moved,
    plate,
    pressed,
    seen,
    shift_and_turn,
)
from tactograph.graph.errors import collect_warnings
from tactograph.graph.files.read_graph import read_graph, with_overlays
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.contact.find_contact import find_contact
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.simulate.press import press
from tactograph.rings.mechanics.nodes.motion.track_pose import TrackedPose, track_pose
from tests.fixtures import Calibration, Raytraced

STEP = np.array([0.12, -0.08, 0.02, 0.2, -0.3, 1.1])
"""mm and degrees a frame."""
PLATE_STEP = np.array([0.6, 0.3, 0, 0, 0, 0.6])
GOAL = np.array([0.05, 0.05, 0.05, 0.3, 0.3, 0.3])
"""mm and degrees."""


def track(surfaces: Iterable[F8]) -> Iterator[TrackedPose]:
    rng, before = np.random.default_rng(3), None
    for surface in surfaces:
        state = (None, None) if before is None else before[2:4]
        before = track_pose(*seen(surface, rng), PIXEL, STATED, *state)
        yield before


def way(shape: Shape, step: F8, count: int) -> tuple[list[F8], list[F8]]:
    """Motions, and the surfaces that they give."""
    motions = [np.eye(4)]
    for _ in range(count):
        motions.append(motions[-1] @ moved(*step))
    return motions, [pressed(shape, motion) for motion in motions]


def astray(found: TrackedPose, motion: F8) -> F8:
    """Pose less truth, in mm and degrees."""
    return shift_and_turn(moved(*found.pose) @ np.linalg.inv(motion))


def test_steps_of_a_textured_object() -> None:
    motions, surfaces = way(coin, STEP, 8)
    for found, motion in zip(track(surfaces), motions, strict=True):
        assert np.all(np.abs(astray(found, motion)) < GOAL / 3)
        assert found.figures["pose_open"] == 0


def test_a_near_camera_enlarges_motion() -> None:
    """Each pixel looks at the point that lies 1 - z / D as far from the middle."""
    camera, before, motion = 1 / 25, None, moved(1.5, 0, 0, 0, 0, 0)
    rows, columns = ((np.indices(SHAPE) - np.array([[[59.5]], [[79.5]]])) * PIXEL).astype(float)
    for at in np.eye(4), motion:
        z = np.zeros(SHAPE)
        for _ in range(50):
            near = 1 - camera * z
            z = np.maximum(coin(columns * near - at[0, 3], rows * near), 0)
        film = z.astype(np.float32)
        state = (None, None) if before is None else before[2:4]
        before = track_pose(
            film, (z > 0.05).astype(np.uint8), PIXEL, STATED, *state, View(camera=camera)
        )
    assert before is not None
    np.testing.assert_allclose(astray(before, motion)[:2], 0, atol=0.01)


def test_drift_over_a_plate_that_is_larger_than_the_film() -> None:
    motions, surfaces = way(plate, PLATE_STEP, 24)
    *_, last = track(surfaces)
    length = float(np.hypot(*motions[-1][:2, 3]))
    assert last.figures["pose_keys"] > 2
    assert np.hypot(*astray(last, motions[-1])[:2]) < 0.01 * length
    assert abs(astray(last, motions[-1])[5]) < GOAL[5]
    assert last.figures["pose_sd_x_mm"] < 0.01 * length


def pose_of_film(
    motions: list[F8], rng: np.random.Generator, variance: F4 | None, reach_mm: float = 0.5
) -> TrackedPose:
    """The pose after the second of two motions of the coin, through a film that hangs beside it."""
    state: tuple[F4, ...] = ()
    for motion in motions:
        film = press(pressed(coin, motion).astype(np.float32), PIXEL, reach_mm=reach_mm)
        film, _ = seen(film, rng)
        found = track_pose(film, find_contact(film), PIXEL, variance, *state)
        state = found[2:4]
    return found


@pytest.mark.parametrize(("reach_mm", "least_deg"), [(0.5, 0.1), (1.0, 0.15), (2.0, 0.35)])
def test_film_that_hangs_holds_hardly_any_tilt_back(reach_mm: float, least_deg: float) -> None:
    """The stated deviation covers its effect, and very tight film gives a warning."""
    motions = [moved(0.3 * n, 0.1 * n, 0, 2.0 * n, 0, 3.0 * n) for n in range(2)]
    with collect_warnings([]) as messages:
        found = pose_of_film(motions, np.random.default_rng(5), STATED, reach_mm)
    off = np.abs(astray(found, motions[1]))
    assert np.all(off < [0.015, 0.015, 0.02, *[least_deg] * 3])
    assert np.all(off[3:] < 3 * np.sqrt(np.diag(found.covariance))[3:])
    assert any("film is tight" in line for line in messages) == (reach_mm > 1)


@pytest.mark.parametrize(
    ("variance", "reach_mm"),
    [
        pytest.param(STATED, 0.5, id="stated"),
        pytest.param(None, 0.5, id="not stated", marks=pytest.mark.slow),
        pytest.param(STATED, 1.0, id="tight", marks=pytest.mark.slow),
    ],
)
def test_the_covariance_is_that_of_the_error(variance: F4 | None, reach_mm: float) -> None:
    """Film hangs over the contact's rim and valleys, and moves by up to a millimetre and 8 degrees.

    A height's zero is known better here than in general.
    """
    rng, kept, apart = np.random.default_rng(5), [0, 1, 3, 4, 5], []
    for _ in range(40):
        motions = [moved(*(rng.uniform(-1, 1, 6) * [0.5, 0.5, 0.02, 1, 1, 4])) for _ in range(2)]
        found = pose_of_film(motions, rng, variance, reach_mm)
        off = astray(found, motions[1] @ np.linalg.inv(motions[0]))
        apart.append((off / np.sqrt(np.diag(found.covariance)))[kept])
    assert 0.4 < np.mean(np.square(apart)) < 1.4
    assert np.mean(np.abs(apart) < 1.645, axis=0).min() > 0.85


@pytest.mark.parametrize("shift", [(1.2, -0.9), (-1.5, 0.6), (5.0, 0)])
def test_a_jump_is_found(shift: tuple[float, float]) -> None:
    """Farther than the finest waves, and turned."""
    motions = [np.eye(4), moved(*shift, 0, 0.5, -0.5, 10)]
    found = pose_of_film(motions, np.random.default_rng(5), STATED)
    assert np.abs(astray(found, motions[1]))[:2].max() < 0.01
    assert found.figures["pose_sure"] == 1


@pytest.mark.parametrize("shift", [(-20.0, 9.0), (40.0, -30.0)])
def test_a_jump_of_many_small_balls_is_found(shift: tuple[float, float]) -> None:
    """The film that they touch together is large; each is small."""
    rng, (y, x) = np.random.default_rng(3), np.mgrid[:480, :600]
    nodes = np.mgrid[20:480:52, 20:600:52].reshape(2, -1).T
    places = nodes + rng.uniform(-4, 4, nodes.shape)
    pixel, key, found = 0.02, None, None
    for right, down in ((0.0, 0.0), shift):
        top = np.full(y.shape, 5.0)
        for row, column in places:
            square = 22**2 - (y - row - down) ** 2 - (x - column - right) ** 2
            top = np.maximum(top, np.sqrt(np.maximum(square, 0)))
        height = (pixel * (top - 5) + rng.normal(0, 2e-4, y.shape)).astype(np.float32)
        found = track_pose(height, find_contact(height), pixel, None, *(key or ()))
        key = found.key, found.memory
    assert found is not None
    assert found.figures["pose_sure"] == found.figures["pose_keys"] == 1
    assert found.pose[:2] / pixel == pytest.approx(shift, abs=0.1)


@pytest.mark.parametrize("side_mm", [20.0, 2.0], ids=["large", "small"])
def test_another_object_is_reported(side_mm: float) -> None:
    def part(x: F8, y: F8) -> F8:
        return plate(x, y) - 0.2 * np.maximum(np.hypot(x, y) - side_mm, 0)

    rng, messages = np.random.default_rng(5), list[str]()
    key = track_pose(*seen(pressed(part, np.eye(4)), rng), PIXEL, STATED)
    other = seen(pressed(lambda x, y: plate(y + 31, -x) + part(x, y) - plate(x, y), np.eye(4)), rng)
    with collect_warnings(messages):
        found = track_pose(*other, PIXEL, STATED, *key[2:4])
    assert found.figures["pose_sure"] == 0
    assert np.abs(found.pose[:2]).max() < 1
    assert messages


@pytest.mark.parametrize(
    ("shape", "still"),
    [
        (ball, {"turn_x", "turn_y", "turn_z"}),
        (cylinder, {"x", "turn_x"}),
        (lambda x, y: np.full_like(x, 0.4), {"x", "y", "turn_z"}),
    ],
    ids=["ball", "cylinder", "plate"],
)
def test_an_unobservable_motion_gives_a_warning(shape: Shape, still: set[str]) -> None:
    _, surfaces = way(shape, np.array([0.1, 0.1, 0.02, 0, 0, 1.1]), 1)
    with collect_warnings([]) as messages:
        _, found = track(surfaces)
    assert "leaves motions open" in messages[0]
    assert {name for name in found.figures if "/" in name} == {f"pose_open/{n}" for n in still}
    assert found.figures["pose_open"] == len(still)
    for name in still:
        unit = "deg" if "turn" in name else "mm"
        assert found.figures[f"pose_sd_{name}_{unit}"] > 10


def test_a_ball_is_followed_though_it_may_turn() -> None:
    """Its middle is where it is, and turns are not guessed."""
    _, surfaces = way(ball, np.array([0.2, 0.1, 0, 0, 0, 0.0]), 5)
    *_, last = track(surfaces)
    assert last.pose[:2] == pytest.approx([1.0, 0.5], abs=0.05)
    assert np.abs(last.pose[3:]).max() < 1


def test_a_new_touch_restarts_tracking() -> None:
    surface, nothing = pressed(coin, np.eye(4)), np.zeros(SHAPE)
    found = [*track([surface, surface, nothing, surface])]
    assert [each.figures["pose_frames"] for each in found] == [1, 2, 0, 1]
    assert [each.figures["pose_sd_x_mm"] > 10 for each in found] == [False, False, True, False]


def test_a_jump_to_another_part_of_the_object_restarts_tracking() -> None:
    surfaces = [pressed(coin, moved(x, 0, 0, 0, 0, 0)) for x in (-8.5, 8.5)]
    _, second = track(surfaces)
    assert second.figures["pose_frames"] == 1
    assert not second.pose.any()


@pytest.mark.parametrize("graph", ["precise", "live", "replay", "ros2", "live_oneshot", "paper"])
def test_the_overlay_fits(graph: str) -> None:
    posed = with_overlays(read_graph(graph), ["pose"])
    assert posed.nodes["pose"].inputs["memory"] == "previous.pose.memory"
    assert "pose" in posed.nodes[posed.in_full("figures")].inputs


@pytest.mark.slow
def test_a_touch_at_rest_does_not_move(
    raytraced: Raytraced, calibration: Calibration, tmp_path: Path
) -> None:
    """Two captures that are the same, through the whole graph."""
    for name in ("0", "1"):
        (tmp_path / name).symlink_to(raytraced / "near33" / "cat_film")
    arguments = {"calibration": calibration("near33"), "capture": str(tmp_path)}
    posed = with_overlays(read_graph("reconstruct"), ["pose"])
    _, second = open_pipeline(posed, arguments, sinks=False).items()
    assert second["metrics"]["pose_frames"] == 2
    assert np.abs(second["pose"]).max() < 1e-3
    assert np.all(np.linalg.eigvalsh(second["covariance"]) > 0)
