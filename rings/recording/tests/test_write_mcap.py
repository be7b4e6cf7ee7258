"""Results as ROS 2 messages, read back by the format's own libraries."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from tactograph.graph import Provenance, Session
from tactograph.nodes.contact.measure_contact import measure_contact
from tactograph.nodes.optics.camera_view import View
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.rings.mechanics.layers.pose import ObjectPose
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.nodes._touch_messages import touch_messages
from tactograph.rings.recording.nodes.write_mcap import write_mcap
from tests.nodes.touches import touch_of

SIZE = (6, 8)
PIXEL = 0.05
HEIGHT = np.linspace(0, 1.5, 48, dtype=np.float32).reshape(SIZE)
IMAGE = np.linspace(0, 1, 4 * 48, dtype=np.float32).reshape(4, *SIZE)
SHADOW = np.arange(48, dtype=np.uint8).reshape(SIZE)
CONTACT = np.zeros(SIZE, np.uint8)
CONTACT[1:4, 2:5], CONTACT[4, 6] = 1, 2
FIGURES = measure_contact(HEIGHT, CONTACT, PIXEL)
MARKERS = np.array([[1, 2, 1.5], [5, 3, 2]], np.float32)
SHIFT = np.array([[0.5, -0.25], [2, 1]], np.float32)
SEEN = np.array([1, 0], np.uint8)
FORCES = {
    "contact_force_n/c1": 1.25,
    "contact_shear_x_n/c1": -0.5,
    "contact_shear_sd_x_n/c1": 0.0625,
    "contact_torque_n_mm/c1": 2.5,
}
POSE = np.array([0.5, -0.25, 0.1, 0, 0, 90], np.float32)
COVARIANCE = np.diag([0.01, 0.01, 0.01, 1, 1, 1]).astype(np.float32)
COVARIANCE[0, 5] = COVARIANCE[5, 0] = 0.02


def provenance(warnings: list[str]) -> Provenance:
    nodes = [{"node": "height", "op": "x", "backend": "numpy", "once": False, "ms": 2.5}]
    return Provenance({"name": "toy"}, None, nodes, {}, {}, warnings, [])


@pytest.fixture
def messages(tmp_path: Path) -> dict[str, list[tuple[Any, Any, Any]]]:
    """By topic, what a reader finds of two touches: schema, message, decoded."""
    session, now = Session(), time.monotonic()
    for number, warnings in enumerate(([], ["too bright"])):
        touch = touch_of(
            height=HEIGHT, image=IMAGE, pixel=PIXEL, name=f"{number:06}", time=now + number / 30,
            metrics={"rmse": 0.5, **FIGURES, **FORCES}, shadow=SHADOW, contact=CONTACT,
            markers=MarkerTracks(MARKERS, SHIFT, SEEN), pose=ObjectPose(POSE, COVARIANCE),
        )  # fmt: skip
        write_mcap(touch, folder=tmp_path, provenance=provenance(warnings), session=session)
    session.close()
    found: dict[str, list[tuple[Any, Any, Any]]] = {}
    for path in log_files(tmp_path):
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for schema, channel, message, decoded in reader.iter_decoded_messages():
                found.setdefault(channel.topic, []).append((schema, message, decoded))
    return found


@pytest.mark.slow
def test_another_reader_of_ros_bags_takes_them_for_the_standard_messages(
    tmp_path: Path, messages: dict[str, Any]
) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # By its own definitions of the messages, not by those in the file.
    store = get_typestore(Stores.ROS2_HUMBLE)
    (path,) = log_files(tmp_path)
    with AnyReader([path], default_typestore=store) as reader:
        found: dict[str, list[Any]] = {}
        for connection, _, raw in reader.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
    assert {topic: len(m) for topic, m in found.items()} == dict.fromkeys(messages, 2)
    height = found["/height"][0]
    metres = height.data.view("<f4").reshape(height.height, height.width)
    np.testing.assert_allclose(metres, HEIGHT / 1000, rtol=1e-6)
    assert [status.message for status in found["/diagnostics"][1].status] == ["too bright"]
    assert found["/contact"][0].encoding == "mono8"
    np.testing.assert_array_equal(found["/contact"][0].data.reshape(SIZE), CONTACT)
    clouds = [points(found[topic][0]) for topic in ("/contacts", "/markers")]
    assert [len(cloud["x"]) for cloud in clouds] == [2, 2]
    assert found["/pose"][0].pose.pose.position.x == pytest.approx((3.5 * PIXEL + 0.5) / 1000)


def test_a_height_is_an_image_in_metres(messages: dict[str, Any]) -> None:
    schema, _, image = messages["/height"][0]
    assert schema.name == "sensor_msgs/msg/Image"
    assert (image.encoding, image.height, image.width, image.step) == ("32FC1", 6, 8, 32)
    metres = np.frombuffer(image.data, "<f4").reshape(SIZE)
    np.testing.assert_allclose(metres, HEIGHT / 1000, rtol=1e-6)


def test_points_lie_where_the_pixels_are_in_metres(messages: dict[str, Any]) -> None:
    schema, _, cloud = messages["/points"][0]
    assert schema.name == "sensor_msgs/msg/PointCloud2"
    assert [(f.name, f.offset, f.datatype) for f in cloud.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
    ]
    assert (cloud.height, cloud.width) == (3, 4)
    assert (cloud.point_step, cloud.row_step, cloud.is_dense) == (12, 48, True)
    points = np.frombuffer(cloud.data, "<f4").reshape(3, 4, 3)
    # Every second row and column.
    np.testing.assert_allclose(points[2, 3], [6 * 5e-5, 4 * 5e-5, HEIGHT[4, 6] / 1000], rtol=1e-6)


def test_points_lie_on_the_film_where_a_lens_shows_them() -> None:
    """As the mesh of the same touch has them, about the image's middle."""
    view = View(np.array([-0.03, 0.01, 0.02, -0.01, 0, 0.01, 0.02, 0.01], np.float32), 1 / 65)
    touch = touch_of(height=HEIGHT, image=IMAGE, pixel=PIXEL, view=view)
    (cloud,) = [m for m in touch_messages(0, touch, 2, provenance([])) if m.topic == "/points"]
    x, y, z = np.moveaxis(np.frombuffer(cloud.body["data"], "<f4").reshape(3, 4, 3), -1, 0)
    mesh = view.mesh(HEIGHT, PIXEL).vertices.reshape(*SIZE, 3)[::2, ::2]
    np.testing.assert_allclose(1e3 * x - 3.5 * PIXEL, mesh[..., 0], atol=1e-5)
    np.testing.assert_allclose(1e3 * y - 2.5 * PIXEL, -mesh[..., 1], atol=1e-5)
    np.testing.assert_allclose(1e3 * z, mesh[..., 2], atol=1e-5)


def points(cloud: Any) -> dict[str, np.ndarray]:
    """The fields of a cloud that is one row, by name."""
    assert (cloud.height, cloud.point_step) == (1, 4 * len(cloud.fields))
    values = np.frombuffer(bytes(cloud.data), "<f4").reshape(cloud.width, len(cloud.fields))
    return {each.name: column for each, column in zip(cloud.fields, values.T, strict=True)}


def test_a_contact_is_a_point_with_figures_in_metres_and_radians(messages: dict[str, Any]) -> None:
    found = points(messages["/contacts"][0][2])
    np.testing.assert_allclose(found["x"], [3 * 5e-5, 6 * 5e-5], rtol=1e-6)
    np.testing.assert_allclose(found["y"], [2 * 5e-5, 4 * 5e-5], rtol=1e-6)
    np.testing.assert_allclose(found["z"], [HEIGHT[3, 4] / 1000, HEIGHT[4, 6] / 1000], rtol=1e-6)
    np.testing.assert_allclose(found["area"], [9 * 5e-5**2, 5e-5**2], rtol=1e-6)
    volume = HEIGHT[1:4, 2:5].sum() * 1e-3 * 5e-5**2
    assert found["volume"][0] == pytest.approx(volume, rel=1e-5)
    assert found["angle"][0] == pytest.approx(np.deg2rad(FIGURES["contact_angle_deg/c1"]))
    np.testing.assert_array_equal(found["cut"], [0, 0])


def test_without_a_contact_there_is_an_empty_cloud(tmp_path: Path) -> None:
    session = Session()
    rest = np.zeros(SIZE, np.float32)
    none = np.zeros(SIZE, np.uint8)
    figures = measure_contact(rest, none, PIXEL)
    touch = touch_of(height=rest, image=IMAGE, pixel=PIXEL, metrics=figures, contact=none)
    write_mcap(touch, folder=tmp_path, provenance=provenance([]), session=session)
    session.close()
    (path,) = log_files(tmp_path)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = {channel.topic: m for _, channel, _, m in reader.iter_decoded_messages()}
    assert (found["/contacts"].width, bytes(found["/contacts"].data)) == (0, b"")
    assert "/markers" not in found


def test_a_marker_is_a_point_with_its_shift_in_metres(messages: dict[str, Any]) -> None:
    found = points(messages["/markers"][0][2])
    names = ("x", "y", "radius", "dx", "dy")
    table = np.column_stack([found[name] for name in names])
    np.testing.assert_allclose(table, 5e-5 * np.hstack([MARKERS, SHIFT]), rtol=1e-6)
    assert found["visible"].tolist() == [1, 0]


def test_a_pose_is_that_of_a_frame_in_the_images_middle(messages: dict[str, Any]) -> None:
    schema, _, stamped = messages["/pose"][0]
    assert schema.name == "geometry_msgs/msg/PoseWithCovarianceStamped"
    place, turn = stamped.pose.pose.position, stamped.pose.pose.orientation
    middle = 1000 * np.array([place.x, place.y, place.z]) - [3.5 * PIXEL, 2.5 * PIXEL, 0]
    np.testing.assert_allclose(middle, POSE[:3], atol=1e-6)
    # A quarter turn about z, from x to y.
    np.testing.assert_allclose([turn.x, turn.y, turn.z, turn.w], [0, 0, 0.5**0.5, 0.5**0.5])
    spread = np.reshape(stamped.pose.covariance, (6, 6))
    assert spread[0, 0] == pytest.approx(0.01e-6)
    assert spread[5, 5] == pytest.approx(np.radians(1) ** 2)
    assert spread[0, 5] == spread[5, 0] == pytest.approx(0.02e-3 * np.radians(1))


def test_the_leds_images_and_the_labels_are_grey_images(messages: dict[str, Any]) -> None:
    for k in range(4):
        image = messages[f"/led{k + 1}/image"][0][2]
        assert image.encoding == "mono8"
        grey = np.frombuffer(image.data, np.uint8).reshape(SIZE)
        np.testing.assert_allclose(grey / 255, IMAGE[k], atol=0.5 / 255 + 1e-6)
    assert messages["/shadow"][0][2].data == SHADOW.tobytes()


def test_diagnostics_hold_times_metrics_and_warnings(messages: dict[str, Any]) -> None:
    schema, _, array = messages["/diagnostics"][0]
    assert schema.name == "diagnostic_msgs/msg/DiagnosticArray"
    (status,) = array.status
    values = {pair.key: pair.value for pair in status.values}
    assert values["height / ms"] == "2.5"
    assert values["rmse"] == "0.5"
    assert float(values["contact_depth_mm/c1"]) == FIGURES["contact_depth_mm/c1"]
    assert {name: float(values[name]) for name in FORCES} == FORCES
    levels = [a.status[0].level for _, _, a in messages["/diagnostics"]]
    assert [int.from_bytes(v) if isinstance(v, bytes) else v for v in levels] == [0, 1]
    assert messages["/diagnostics"][1][2].status[0].message == "too bright"


def test_all_of_a_touch_bears_the_stamp_of_its_exposure(messages: dict[str, Any]) -> None:
    stamps = np.array([[message.log_time for _, message, _ in m] for m in messages.values()])
    assert (stamps == stamps[0]).all()
    assert stamps[0, 1] - stamps[0, 0] == pytest.approx(1e9 / 30, abs=1000)
    assert stamps[0, 0] / 1e9 == pytest.approx(time.time(), abs=60)
    header = messages["/height"][0][2].header
    assert 10**9 * header.stamp.sec + header.stamp.nanosec == stamps[0, 0]
    assert [decoded.data for _, _, decoded in messages["/touch"]] == ["000000", "000001"]
