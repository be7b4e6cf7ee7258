"""Films with markers under a simulated camera, from calibration to heights and shifts."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_sensor import read_scene
from tests.fixtures import MadeOnce
from tests.pipelines.conftest import run

PIXEL_MM = 1 / 7
SIZE = {"width_px": 160, "height_px": 120, "pixel_size_mm": PIXEL_MM}
RIG = {"slant_deg": 33, "distance_mm": 60}
PRINT = {"pitch_mm": 2.0, "marker_mm": 0.25}
DRAG_MM = 0.8
SCENE = {
    **SIZE, **RIG, "marker_pitch_mm": 2.0, "marker_mm": 0.25, "drag_mm": DRAG_MM,
    "depth_mm": 0.8, "path_mm": 1, "press_s": 4,
}  # fmt: skip
CAMERA = "simulated?" + "&".join(f"{name}={value}" for name, value in SCENE.items())


@pytest.fixture(scope="module")
def printed(made_once: MadeOnce) -> Path:
    """The calibration of a simulated sensor whose film has markers."""

    def make(folder: Path) -> None:
        run("simulate_markers_flat", folder / "flat", seed=2, **PRINT, **SIZE, **RIG)
        run("simulate_markers", folder / "ball", radius_mm=5.0, seed=1, **PRINT, **SIZE, **RIG)
        known = {"ball_radius_mm": 5.0, "pixel_size_mm": PIXEL_MM}
        taken = {"capture": folder / "ball", "flat": folder / "flat"}
        run("calibrate_markers", folder / "cal.npz", **taken, **known)

    return made_once("live_markers", make) / "cal.npz"


@pytest.mark.slow
@pytest.mark.parametrize(("drag", "slips"), [(1.0, 0.0), (0.0, 2.0)], ids=["with", "without"])
def test_a_pyramid_that_is_pushed_with_its_film_is_stuck_and_without_slips(
    printed: Path, tmp_path: Path, drag: float, slips: float
) -> None:
    step_mm = 0.05  # the simulated film is dragged less away from its middle
    for n in range(3):
        pyramid = {"inradius_mm": 4.0, "rise_mm": 1.5, "offset_mm": [step_mm * n, 0.0], **SIZE}
        shape = {"replace": "shape", "op": "shape_pyramid", "with": pyramid}
        pushed = {"format": 1, "extends": "simulate_markers", "title": "pushed", "patch": [shape]}
        arguments = {"out": tmp_path / f"{n}", "drag_x_mm": drag * step_mm * n, **PRINT, **RIG}
        list(open_pipeline(pushed, arguments).items())
    arguments = {"calibration": printed, "capture": tmp_path}
    graph = read_graph("reconstruct_slip")
    *_, last = [
        result["metrics"] for result in open_pipeline(graph, arguments, sinks=False).items()
    ]
    assert last["pose_x_mm"] == pytest.approx(2 * step_mm, abs=0.02)
    assert last["contact_slip/c1"] == slips
    assert last["contact_slip_markers/c1"] > 5


def followed(graph: str, arguments: dict[str, Any]) -> np.ndarray:
    """Of each touch the height's RMSE, true depth, longest shift in x in px, and share seen."""
    touches = []
    with open_pipeline(graph, arguments) as pipeline:
        for result in pipeline.items():
            truth = next(made for value, made in result.item.items() if value.port == "truth")
            error = np.sqrt(np.mean((result["height"] - truth) ** 2))
            shift = np.abs(result["marker_shift"][:, 0]).max()
            touches.append([error, truth.max(), shift, result["marker_visible"].mean()])
    assert len(touches) > 10
    return np.array(touches).T


@pytest.mark.realtime
def test_heights_and_markers_are_followed_while_the_ball_presses_and_drags(
    printed: Path, tmp_path: Path
) -> None:
    arguments = {"calibration": printed, "camera": CAMERA, "port": "none", "seconds": 12}
    arguments |= {"out": tmp_path, "pictures": str(tmp_path / "pictures")}
    errors, depths, shifts, seen = followed("live_markers", arguments)
    assert np.median(errors) < 0.012
    assert np.median(seen) > 0.95
    # The markers go with the ball, and come back with it.
    assert PIXEL_MM * shifts.max() == pytest.approx(DRAG_MM, abs=0.15)
    assert np.corrcoef(depths, shifts)[0, 1] > 0.9
    assert cv2.imread(str(tmp_path / "pictures" / "latest.png")) is not None


@pytest.mark.realtime
def test_a_recording_gives_contacts_and_markers_as_topics(printed: Path, tmp_path: Path) -> None:
    arguments = {"calibration": printed, "recording": tmp_path / "frames"}
    live = {"camera": CAMERA, "port": "none", "seconds": 6, "out": tmp_path / "live"}
    written = {"out": tmp_path / "heights", "refresh": "cycle"}
    for graph, more in (("record", live), ("replay_mcap_markers", written)):
        with open_pipeline(graph, {**arguments, **more}) as pipeline:
            list(pipeline.items())
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    heard: dict[str, list[Any]] = {}
    with AnyReader(sorted((tmp_path / "heights").glob("*.mcap")), default_typestore=store) as bag:
        for connection, _, raw in bag.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            heard.setdefault(connection.topic, []).append(message)
    count = len(heard["/touch"])
    assert count > 5
    for topic in ("/height", "/contact", "/contacts", "/markers", "/diagnostics"):
        assert len(heard[topic]) == count
    shifts = [column(cloud, "dx").max() for cloud in heard["/markers"]]
    assert 1000 * max(shifts) == pytest.approx(DRAG_MM, abs=0.2)
    depths = [column(cloud, "z").max(initial=0) for cloud in heard["/contacts"]]
    assert 1000 * max(depths) == pytest.approx(0.8, abs=0.1)
    assert {len(np.unique(each.data)) - 1 for each in heard["/contact"]} <= {0, 1}


def column(cloud: Any, name: str) -> np.ndarray:
    """One field of a sensor_msgs/PointCloud2."""
    names = [field.name for field in cloud.fields]
    return cloud.data.view("<f4").reshape(-1, len(names))[:, names.index(name)]


COLOUR = "simulated?width_px=120&height_px=90&pixel_size_mm=0.16&radius_mm=3&depth_mm=0.8"
COLOUR += "&full_well=150000&by_hand=true&path_mm=8&press_s=0.8&rest_s=4"
BY_HAND = f"{COLOUR}&marker_pitch_mm=2&marker_mm=0.25&drag_mm=0.5"


def press_by_press(camera: str, out: Path, presses: int) -> list[np.ndarray]:
    """Keep the untouched film and presses as a user would; the true heights of the presses."""
    sensor = SimulatedColourSensor(read_scene(camera, ColourScene), start=0.0)
    scene = sensor.scene
    film = np.mean([sensor.picture(0.0, n) for n in range(8)], axis=0)
    out.mkdir()
    cv2.imwrite(str(out / "background.png"), np.rint(film).astype(np.uint8))
    truths = []
    for i in range(presses):
        held = scene.rest_s + (i + 0.3) * scene.press_s
        (out / "presses" / f"{i:02}").mkdir(parents=True)
        cv2.imwrite(str(out / "presses" / f"{i:02}" / "image.png"), sensor.picture(held, i))
        truths.append(sensor.true_height(held))
    return truths


KNOWN = {"ball_radius_mm": 3.0, "pixel_size_mm": 0.16}


@pytest.fixture(scope="module")
def one_shot(made_once: MadeOnce) -> Path:
    """Presses into a film without markers and into one with, and calibrations from them."""

    def make(folder: Path) -> None:
        folder.mkdir()
        for name, camera, graph in (
            ("plain", COLOUR, "calibrate_presses"),
            ("printed", BY_HAND, "calibrate_presses_markers"),
        ):
            film = folder / name
            np.save(folder / f"{name}.npy", press_by_press(camera, film, 14))
            taken = {"captures": film / "presses", "flat": film / "background.png"}
            run(graph, film / "cal.npz", **taken, **KNOWN)

    return made_once("one_shot_markers", make)


@pytest.mark.slow
def test_a_one_shot_sensor_is_calibrated_and_read_in_spite_of_its_markers(one_shot: Path) -> None:
    errors = {}
    for name, graph in (("plain", "gelsight_mini"), ("printed", "gelsight_mini_markers")):
        truths, errors[name] = np.load(one_shot / f"{name}.npy"), []
        for i in (1, 4, 7):
            touch = one_shot / name / "presses" / f"{i:02}"
            found = run(graph, capture=touch, calibration=one_shot / name / "cal.npz")
            errors[name].append(float(np.sqrt(np.mean((found["height"] - truths[i]) ** 2))))
            if name == "printed":
                assert found["markers"]["visible_markers_percent"] > 90
                assert found["markers"]["marker_shift_mm"] == pytest.approx(0.5, abs=0.15)
    assert np.mean(errors["printed"]) < 1.5 * np.mean(errors["plain"])


@pytest.mark.realtime
def test_a_one_shot_sensors_markers_are_followed_live(one_shot: Path, tmp_path: Path) -> None:
    camera = BY_HAND.replace("&by_hand=true&path_mm=8&press_s=0.8&rest_s=4", "&path_mm=1&press_s=4")
    arguments = {"calibration": one_shot / "printed/cal.npz", "camera": camera, "seconds": 8}
    arguments |= {"out": tmp_path, "pictures": str(tmp_path / "pictures")}
    errors, _, shifts, seen = followed("live_oneshot_markers", arguments)
    assert np.median(errors) < 0.015
    assert np.median(seen) > 0.9
    assert KNOWN["pixel_size_mm"] * shifts.max() == pytest.approx(0.5, abs=0.15)
    assert cv2.imread(str(tmp_path / "pictures" / "latest.png")) is not None
