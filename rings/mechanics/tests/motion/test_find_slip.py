"""Slip of simulated markers under objects whose motion is known."""

from collections.abc import Iterator

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
    height_at,
    moved,
    pressed,
    seen,
    shift_and_turn,
)
from tactograph.nodes import Metrics
from tactograph.nodes.optics.camera_view import View
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tactograph.rings.mechanics.nodes.motion.find_slip import Slip, find_slip
from tactograph.rings.mechanics.nodes.motion.track_pose import track_pose

MIDDLE = np.array([SHAPE[1] - 1, SHAPE[0] - 1]) / 2
MARKER_NOISE_PX, VERGENCE, STEP_MM = 0.05, 1 / 40, 0.08
POSE_SD = np.array([0.003, 0.003, 0.01, 0.1, 0.1, 0.05])
"""mm and degrees, about what `track_pose` states for the coin."""
FRONTS = [*[9.0] * 8, *np.linspace(3, 0, 12), *[0.0] * 6]
"""Radius within which the film sticks, mm."""
VIEW = View(None, VERGENCE)


class Film:
    """Film with markers every 0.8 mm, which the object drags where it holds it."""

    def __init__(self, shape: Shape) -> None:
        self.shape, self.rng = shape, np.random.default_rng(4)
        y, x = np.mgrid[-5:5.1:0.8, -7:7.1:0.8]
        self.rest = np.column_stack([x.ravel(), y.ravel()])
        self.at, self.motion = self.rest.copy(), np.eye(4)

    def drag(self, motion: F8, stuck_mm: float = np.inf) -> MarkerTracks:
        """Move the object; within `stuck_mm` of its middle markers go with it."""
        z = height_at(self.shape, self.motion, *self.at.T)
        on_object = (np.column_stack([self.at, z]) - self.motion[:3, 3]) @ self.motion[:3, :3]
        held = (z > 0.05) & (np.hypot(*on_object[:, :2].T) < stuck_mm)
        self.at[held] = (on_object @ motion[:3, :3].T + motion[:3, 3])[held, :2]
        self.motion = motion
        return self.tracks()

    def tracks(self) -> MarkerTracks:
        z = np.maximum(height_at(self.shape, self.motion, *self.at.T), 0)
        shown = self.at / (1 - z * VERGENCE)[:, None] / PIXEL + MIDDLE
        shown += self.rng.normal(0, MARKER_NOISE_PX, shown.shape)
        rest = np.column_stack([self.rest / PIXEL + MIDDLE, np.full(len(shown), 2.0)])
        shift = (shown - rest[:, :2]).astype(np.float32)
        return MarkerTracks(rest.astype(np.float32), shift, np.ones(len(rest), np.uint8))


def follow(film: Film, way: list[tuple[F8, float]], *, fitted: bool) -> Iterator[Slip]:
    """Slip frame by frame, by fitted poses or by true ones with noise."""
    rng, slides, state = np.random.default_rng(5), None, (None, None)
    for frame, (motion, stuck_mm) in enumerate(way):
        surface = pressed(film.shape, motion)
        height, contact = surface.astype(np.float32), (surface > 0.05).astype(np.uint8)
        tracks = film.drag(motion, stuck_mm)
        if fitted:
            height, contact = seen(surface, rng)
            found = track_pose(height, contact, PIXEL, STATED, *state)
            state, pose = found[2:4], ObjectPose(found.pose, found.covariance)
        else:
            spread = POSE_SD * (frame > 0)
            drawn = shift_and_turn(motion) + rng.normal(0, 1, 6) * spread
            pose = ObjectPose(drawn.astype(np.float32), np.diag(spread**2).astype(np.float32))
        slip = find_slip(height, contact, tracks, pose, PIXEL, VIEW, slides)
        slides = slip.slides
        yield slip


def front(film: Film) -> tuple[F8, F8, F8]:
    """State, stated share and true share of slip by frame.

    Stuck at first; a front of 3 mm runs inwards, all slips, and the drag ends.
    """
    way = [(moved(STEP_MM * n - 0.5, 0, 0, 0, 0, 0.3 * n), edge) for n, edge in enumerate(FRONTS)]
    way, stated = way + [way[-1]] * 6, []
    for slip, (motion, edge) in zip(follow(film, way, fitted=True), way, strict=True):
        away = np.hypot(*(film.at - motion[:2, 3]).T)
        true = float(np.mean(away[away < 2.8] > edge))
        names = "contact_slip/c1", "contact_slip_share/c1", "contact_slip_mm/c1"
        stated.append([*(slip.figures.get(name, 0.0) for name in names), true])
    return np.array(stated).T


def onsets(state: F8, true: F8) -> list[int]:
    """Frames by which partial and whole slip are reported late."""
    return [
        int(np.argmax(state >= level) - np.argmax(true > least))
        for level, least in ((1, 0.1), (2, 0.9))
    ]


@pytest.mark.slow
def test_an_inward_slip_front_is_reported_within_two_frames() -> None:
    state, share, way_mm, true = front(Film(coin))
    assert all(-1 <= late <= 2 for late in onsets(state, true))
    dragged = np.arange(len(state)) < len(FRONTS)
    assert np.all(share[2:][dragged[2:]] > np.roll(true, 2)[2:][dragged[2:]] - 0.12)
    assert np.all(share[dragged] < true[dragged] + 0.12)
    assert state[-3:].tolist() == [0, 0, 0]
    assert way_mm[-1] > 10 * STEP_MM


def stuck(frames: int) -> list[Metrics]:
    """Figures of a dome that moves with the film to and fro, turning and leaning."""
    t = np.arange(frames)[:, None] / np.array([37, 53, 71, 43, 61, 47])
    motions = np.array([0.8, 0.6, 0.03, 2, 2, 6]) * np.sin(2 * np.pi * t)
    # The poses are given: a dome needs no texture.
    film = Film(lambda x, y: 0.4 - (x**2 + y**2) / 40)
    slips = follow(film, [(moved(*six), np.inf) for six in motions], fitted=False)
    return [slip.figures for slip in slips]


@pytest.mark.slow
def test_an_object_that_moves_with_the_film_does_not_slip() -> None:
    first, *figures = stuck(1000)
    assert not first
    assert min(each["contact_slip_markers/c1"] for each in figures) > 20
    assert max(each["contact_slip_share/c1"] for each in figures) == 0


def test_a_ball_may_roll_or_slip() -> None:
    """Its shape does not tell, and so there are no figures."""
    way = [(moved(0.1 * n, 0, 0, 0, 0, 0), 0.0) for n in range(4)]
    assert not any(slip.figures for slip in follow(Film(ball), way, fitted=True))
