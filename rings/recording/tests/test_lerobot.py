"""Touches as rows of a LeRobot dataset; LeRobot itself reads and writes where it is installed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tactograph.graph import InputError, Provenance, Session
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.contact.measure_contact import measure_contact
from tactograph.nodes.stream.touch import Touch
from tactograph.rings.export.height_levels import OFFSET_MM, STEP_MM, height_levels, level_height
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tactograph.rings.recording.files.lerobot_rows import Column, touch_columns
from tactograph.rings.recording.files.level_pictures import levels_picture, picture_levels
from tactograph.rings.recording.nodes.read_lerobot import read_lerobot
from tactograph.rings.recording.nodes.write_lerobot import write_lerobot
from tests.nodes.touches import touch_of

SIZE = (6, 8)
PIXEL = 0.05
HEIGHT = np.linspace(-0.1, 1.5, 48, dtype=np.float32).reshape(SIZE)
BYTES = np.random.default_rng(1).integers(0, 256, (4, *SIZE), np.uint8)
CONTACT = np.zeros(SIZE, np.uint8)
CONTACT[1:4, 2:5] = 1
POSE = ObjectPose(np.arange(6, dtype=np.float32), np.eye(6, dtype=np.float32))
STAMP_NS = 1_700_000_000_123_456_789


def a_touch(**changed: Any) -> Touch:
    image = BYTES / np.float32(255)
    metrics = measure_contact(HEIGHT, CONTACT, PIXEL)
    known = {"height": HEIGHT, "image": image, "pixel": PIXEL, "metrics": metrics}
    return touch_of(**known | changed)


def columns_of(
    touch: Touch, figures: str = "x_mm depth_mm", contacts: int = 2
) -> dict[str, Column]:
    origin = {"sensor": "bench", "serial": "", "hash": "0"}
    return touch_columns(touch, STAMP_NS, "left", figures.split(), contacts, origin)


def test_a_height_survives_as_a_picture_to_half_a_level() -> None:
    levels = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    np.testing.assert_array_equal(picture_levels(levels_picture(levels)), levels)
    back = level_height(height_levels(HEIGHT), STEP_MM, OFFSET_MM)
    assert np.abs(back - HEIGHT).max() < 0.51 * STEP_MM


def test_a_value_that_a_row_cannot_hold_is_refused() -> None:
    high = np.where(HEIGHT > 1.4, np.float32(6), HEIGHT)
    with pytest.raises(InputError, match=r"from -0.10 to 6.00 mm do not fit into -0.9999 to 5.55"):
        columns_of(a_touch(height=high))
    with pytest.raises(InputError, match=r"'force_n' is not measured here; angle_deg, area_mm2, "):
        columns_of(a_touch(), "depth_mm force_n")


def test_a_row_holds_height_lights_contacts_pose_and_time() -> None:
    """With scale, sensor and calibration; a contact that is not there is zero."""
    columns = columns_of(a_touch(pose=POSE))
    feature = columns["observation.images.left_height"].feature
    assert (feature["dtype"], feature["shape"]) == ("image", (*SIZE, 3))
    assert feature["names"] == ["height", "width", "channels"]
    scale = {"unit": "mm", "step": 1e-4, "offset": -1.0, "sensor": "bench", "hash": "0"}
    assert scale.items() <= feature["info"].items()
    first, second = (columns[f"observation.images.left_lights{n}"] for n in (1, 4))
    np.testing.assert_array_equal(first.value, BYTES[:3].transpose(1, 2, 0))
    np.testing.assert_array_equal(second.value[..., 0], BYTES[3])
    assert not second.value[..., 1:].any()
    assert [c.info["lights"] for c in (first, second)] == [[1, 2, 3], [4]]
    contacts = columns["observation.left.contacts"]
    assert contacts.names == ["x_mm_c1", "depth_mm_c1", "x_mm_c2", "depth_mm_c2"]
    metrics = measure_contact(HEIGHT, CONTACT, PIXEL)
    expected = [metrics["contact_x_mm/c1"], metrics["contact_depth_mm/c1"], 0, 0]
    np.testing.assert_allclose(contacts.value, expected, rtol=1e-6)
    np.testing.assert_array_equal(columns["observation.left.pose"].value, POSE.pose)
    seconds, parts = columns["left.time"].value
    assert int(seconds) * 10**9 + int(parts) == STAMP_NS
    fewer = columns_of(a_touch(), contacts=0).keys()
    assert not fewer & {"observation.left.pose", "observation.left.contacts"}


def test_another_kind_of_folder_is_not_a_dataset(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is no LeRobot dataset, meta/info.json is missing"):
        next(read_lerobot(dataset=tmp_path))


@pytest.fixture
def lerobot() -> None:
    pytest.importorskip("lerobot", reason="brings PyTorch; 'make test-lerobot' installs it")


def write(
    folder: Path, touches: list[Touch], sensor: str = "touch", serial: str = "", **how: Any
) -> None:
    """Write one episode."""
    inputs = {"calibration": {"sensor": sensor, "serial": serial, "hash": "0"}}
    provenance = Provenance({"name": "toy"}, None, [], {}, {}, [], [], inputs=inputs)
    session = Session()
    for touch in touches:
        how_ = {"sensor": sensor, **how}
        write_lerobot(touch, folder=folder, provenance=provenance, session=session, **how_)
    session.close()


def times(count: int, rate: float = 30.0) -> list[float]:
    """Exposures of a camera whose clock jitters."""
    rng = np.random.default_rng(3)
    return [1000 + n / rate + rng.uniform(-0.003, 0.003) for n in range(count)]


@pytest.mark.slow
@pytest.mark.usefixtures("lerobot")
def test_a_thousand_frames_of_two_sensors_come_back_to_the_bit(tmp_path: Path) -> None:
    for sensor, seed in (("left", 1), ("right", 2)):
        rng = np.random.default_rng(seed)
        heights = rng.uniform(-0.5, 5, (500, *SIZE)).astype(np.float32)
        frames = rng.integers(0, 256, (500, 4, *SIZE), np.uint8)
        sent = times(500)
        touches = [
            a_touch(height=height, image=frame / np.float32(255), time=time)
            for height, frame, time in zip(heights, frames, sent, strict=True)
        ]
        write(tmp_path / sensor, touches, sensor)
        came = list(read_lerobot(dataset=tmp_path / sensor, sensor=sensor))
        assert len(came) == 500
        for touch, height, frame, time in zip(came, heights, frames, sent, strict=True):
            np.testing.assert_array_equal(height_levels(touch.recorded), height_levels(height))
            np.testing.assert_array_equal(touch.image, frame / np.float32(255))
            assert touch.time == pytest.approx(time, abs=1e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("lerobot")
def test_lerobot_itself_reads_scale_rows_and_times_of_other_cameras(tmp_path: Path) -> None:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from lerobot.datasets.utils import dataset_to_policy_features

    write(tmp_path / "data", [a_touch(time=time, pose=POSE) for time in times(40)], task="press")
    rows = LeRobotDataset("local/data", root=tmp_path / "data")
    assert (len(rows), rows.fps, rows[7]["task"]) == (40, 30, "press")
    assert float(rows[7]["timestamp"]) == pytest.approx(7 / 30)
    red, green, _ = 255 * np.asarray(rows[7]["observation.images.touch_height"])
    scale = rows.features["observation.images.touch_height"]["info"]
    height = scale["offset"] + scale["step"] * np.rint(256 * red + green)
    np.testing.assert_allclose(height, HEIGHT, atol=0.51 * STEP_MM)
    kinds = {
        name: each.type.value for name, each in dataset_to_policy_features(rows.features).items()
    }
    assert kinds["observation.images.touch_height"] == "VISUAL"
    assert kinds["observation.touch.contacts"] == kinds["observation.touch.pose"] == "STATE"
    assert "touch.time" not in kinds


@pytest.mark.slow
@pytest.mark.usefixtures("lerobot")
def test_rows_are_even_where_touches_are_missing_or_too_many(tmp_path: Path) -> None:
    """The touch before is repeated; those that come faster are left out and counted."""
    write(tmp_path / "gap", [a_touch(time=1000 + n / 30) for n in (0, 1, 2, 6, 7)])
    came = read_lerobot(dataset=tmp_path / "gap")
    assert [round(30 * (touch.time - 1000)) for touch in came] == [0, 1, 2, 2, 2, 2, 6, 7]
    with collect_warnings([]) as warnings:
        write(tmp_path / "fast", [a_touch(time=time) for time in times(60, rate=60)])
    assert any("touches came faster than 30 rows per second" in line for line in warnings)
    assert len(list(read_lerobot(dataset=tmp_path / "fast"))) in (30, 31)


@pytest.mark.slow
@pytest.mark.usefixtures("lerobot")
def test_a_second_stream_is_a_second_episode_but_not_of_another_kind(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    for _ in range(2):
        write(folder, [a_touch()] * 3)
    names = [touch.name for touch in read_lerobot(dataset=folder, episode=1)]
    assert names == ["0001_000000", "0001_000001", "0001_000002"]
    with pytest.raises(InputError, match=r"episodes differ in observation.images.touch_height"):
        write(folder, [a_touch(pixel=0.1)])
    with pytest.raises(InputError, match=r"has 30 rows per second, not 10"):
        write(folder, [a_touch()], rate=10)
    with pytest.raises(InputError, match=r"has 2 episodes"):
        next(read_lerobot(dataset=folder, episode=2))
    with pytest.raises(InputError, match=r"no sensor 'right'; it has `sensor`=touch"):
        next(read_lerobot(dataset=folder, sensor="right"))


@pytest.mark.slow
@pytest.mark.usefixtures("lerobot")
def test_another_sensor_s_dataset_is_refused_unless_it_is_taken_on_purpose(tmp_path: Path) -> None:
    folder, file = tmp_path / "data", tmp_path / "cal.npz"
    write(folder, [a_touch()], "left")
    np.savez(file, about=np.array(json.dumps({"sensor": "right"})))
    both = r"is of sensor 'left', but the calibration .* is of sensor 'right'"
    with pytest.raises(InputError, match=both):
        next(read_lerobot(dataset=folder, sensor="left", calibration=file))
    with collect_warnings([]) as warnings:
        next(read_lerobot(dataset=folder, sensor="left", calibration=file, another_sensor=True))
    assert any("taken on purpose" in line for line in warnings)
