"""The sensor made of software shows what the simulator renders, at a camera's pace."""

import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.simulate.render import render
from tactograph.rings.live.nodes.simulated.simulated_camera import SimulatedCamera
from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    Scene,
    SimulatedSensor,
    read_scene,
)
from tactograph.rings.mechanics.nodes.marker.find_markers import find_markers
from tactograph.rings.mechanics.nodes.marker.marker_darkness import marker_darkness
from tactograph.rings.mechanics.nodes.marker.track_markers import track_markers

pytestmark = pytest.mark.realtime

SCENE = Scene(
    width_px=160, height_px=120, pixel_size_mm=1 / 7, slant_deg=33, distance_mm=60, exposure_s=0.01
)
SENSOR = SimulatedSensor(SCENE, start=0.0)


def under(led: int) -> list[np.ndarray]:
    return [np.full(SCENE.height_px, k + 1 == led, np.float32) for k in range(4)]


@pytest.mark.parametrize("moment", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("led", [1, 3])
def test_a_frame_equals_what_the_simulator_renders(moment: float, led: int) -> None:
    surface = SENSOR.true_height(moment)
    rendered = render(surface, SCENE.pixel_size_mm, SENSOR.lights).light[led - 1]
    frames = [SENSOR.image(under(led), moment, n) for n in range(8)]
    # Where the film bends most, the renderer's central differences blunt its slopes.
    apart = np.abs(np.mean(frames, axis=0) / 255 - rendered)
    assert apart.mean() < 0.003
    assert np.quantile(apart, 0.99) < 0.015


def test_markers_are_on_the_film_and_are_dragged_with_the_ball() -> None:
    printed = {"marker_pitch_mm": 2.0, "drag_mm": 0.8, "path_mm": 0.0}
    sensor = SimulatedSensor(replace(SCENE, **printed), start=0.0)
    at_rest, deepest = (
        marker_darkness(sensor.image(under(1), t, 1)[None] / np.float32(255)) for t in (0.0, 4.0)
    )
    markers = find_markers(at_rest)
    columns, rows = ((n / 7 - 2) // 2 for n in (SCENE.width_px, SCENE.height_px))
    assert len(markers) >= columns * rows
    tracks = track_markers(deepest, markers, SCENE.pixel_size_mm)
    assert tracks.tracks.visible.mean() > 0.9
    assert tracks.quality["marker_shift_mm"] == pytest.approx(0.8, abs=0.08)
    far = np.hypot(*(markers[:, :2] - [79.5, 59.5]).T) > 10 * 7
    assert np.abs(tracks.tracks.shift[far]).max() / 7 < 0.1


def test_a_film_without_markers_is_as_before() -> None:
    plain, scene = SENSOR.image(under(1), 4.0, 1), replace(SCENE, marker_mm=0.4, drag_mm=1.0)
    np.testing.assert_array_equal(SimulatedSensor(scene, start=0.0).image(under(1), 4.0, 1), plain)


def test_the_ball_goes_down_and_up_and_round_and_noise_never_repeats() -> None:
    assert SENSOR.true_height(0.0).max() == 0
    assert 0.8 < SENSOR.true_height(4.0).max() < 1
    first, later = (np.unravel_index(SENSOR.true_height(t).argmax(), (120, 160)) for t in (3, 9))
    assert np.hypot(*np.subtract(first, later)) > 20
    assert not np.array_equal(SENSOR.image(under(1), 0.0, 1), SENSOR.image(under(1), 0.0, 2))


@pytest.mark.parametrize(
    ("exposure_s", "rate", "exposed", "kept"),
    [(None, 30, 0.02, 30), (None, 60, 0.01, 60), (0.02, 60, 0.02, 50), (0.01, 60, 0.01, 60)],
)
def test_an_exposure_is_no_longer_than_its_frame(
    exposure_s: float | None, rate: float, exposed: float, kept: float
) -> None:
    camera = SimulatedCamera(SimulatedSensor(replace(SCENE, exposure_s=exposure_s)), None)
    camera.set(cv2.CAP_PROP_FPS, rate)
    assert camera.get(cv2.CAP_PROP_FPS) == pytest.approx(kept)
    assert camera.sensor.exposure_s == pytest.approx(exposed)


def test_a_rolling_shutter_sees_a_change_of_led_further_down_in_later_rows() -> None:
    sensor = SimulatedSensor(replace(SCENE, readout_s=0.01), start=0.0)
    change = 1 / 30 - 0.01
    camera = SimulatedCamera(
        sensor,
        lambda begin, end: [
            (1, max(min(change, end) - begin, 0) / (end - begin)),
            (2, max(end - max(change, begin), 0) / (end - begin)),
        ],
    )
    first, second, *_ = camera._shares(1 / 30)
    assert first[0] > 0.9
    assert second[-1] > 0.9
    assert (np.diff(second) >= 0).all()
    assert first + second == pytest.approx(1, abs=0.03)


def test_frames_come_at_the_cameras_rate_whether_they_are_fetched_or_not() -> None:
    camera = SimulatedCamera(SimulatedSensor(SCENE), lambda begin, end: [(1, 1.0)])
    assert camera.grab()
    first = camera.get(cv2.CAP_PROP_POS_MSEC)
    time.sleep(0.25)
    assert camera.grab()
    frames = (camera.get(cv2.CAP_PROP_POS_MSEC) - first) * 30 / 1000
    assert frames == pytest.approx(round(frames), abs=1e-3)
    assert frames >= 7


def test_a_closed_camera_delivers_nothing() -> None:
    camera = SimulatedCamera(SimulatedSensor(SCENE), lambda begin, end: [(1, 1.0)])
    assert camera.grab()
    camera.release()
    assert not camera.grab()
    assert not camera.isOpened()


def test_a_scene_follows_a_question_mark() -> None:
    assert read_scene("simulated", Scene) == Scene()
    assert read_scene("simulated?radius_mm=3&seed=4", Scene) == Scene(radius_mm=3, seed=4)
    with pytest.raises(InputError, match="depth is no setting; did you mean 'depth_mm'"):
        read_scene("simulated?depth=1", Scene)
