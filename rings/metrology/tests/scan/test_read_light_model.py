"""Light models and scans: what their writer means, and what is refused."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.metrology.tests.scan.scans import GAIN, HEIGHT, LEDS, PIXEL, WIDTH, write_scan
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.capture.read_balls import read_balls
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model
from tactograph.rings.metrology.nodes.scan.scan_file import read_scan
from tests.fixtures import real_data


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    write_scan(tmp_path / "scan", np.full((LEDS, HEIGHT, WIDTH), 0.5, np.float32))
    return tmp_path / "scan/scan.yaml"


def test_a_model_is_read_slips_of_its_writer_included(model_file: Path) -> None:
    found = read_light_model(file=model_file)
    assert found.pixel_size == PIXEL
    assert found.model.quadratic.shape == (LEDS, 11, 15)
    assert found.model.gain is not None
    np.testing.assert_allclose(found.model.gain, np.full((LEDS, HEIGHT, WIDTH), GAIN), rtol=1e-4)


def test_a_scan_names_its_model_with_a_path_of_another_computer(
    scan: Path, model_file: Path
) -> None:
    scan.write_text(scan.read_text().replace('""', f"C:\\data\\{model_file.name}"))
    assert read_light_model(file=scan.parent).pixel_size == PIXEL


def test_images_come_in_the_order_of_the_list(tmp_path: Path) -> None:
    light = np.linspace(0.2, 0.7, LEDS, dtype=np.float32)[:, None, None] * np.ones((HEIGHT, WIDTH))
    write_scan(tmp_path / "scan", light)
    (capture,) = read_capture(folder=tmp_path / "scan")
    assert capture.image[:, 0, 0] == pytest.approx(light[:, 0, 0], abs=1e-4)
    (two_left_out,) = read_capture(folder=tmp_path / "scan", leds=(6, 3, 2, 1))
    assert two_left_out.image[0, 0, 0] == pytest.approx(0.7, abs=1e-4)


def test_marked_balls_are_read(scan: Path) -> None:
    """Notes in a language of its own are Windows' text."""
    scan.write_text(f"{scan.read_text()}note: Prüfling\n", encoding="cp1252")
    (circle,) = read_scan(scan.parent).balls
    assert (circle.column, circle.row, circle.x, circle.radius) == (1, -2, 30.5, 9)


def test_the_one_image_of_a_scan_is_in_colour(tmp_path: Path) -> None:
    (tmp_path / "scan.yaml").write_text("images: [image01.png]\ncrop: [0, 0, 0, 0]\n")
    cv2.imwrite(str(tmp_path / "image01.png"), np.full((8, 9, 3), (20, 120, 220), np.uint8))
    (capture,) = read_capture(folder=tmp_path)
    assert capture.image[:, 0, 0] == pytest.approx(np.array([220, 120, 20]) / 255)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("nL: 6", "images: []", "images: is a scan; give its folder, or the model"),
        ("nL: 6", "nL: 2", "nL: input should be greater than or equal to 3"),
        ("    cols: 18", "    cols: 17", "linfit: 54 values in 3 rows of 17"),
        ("    rows: 3", "    rows: 4", "has 4 rows; known are 1, 3, 6, 10, 15"),
        ("quadfit: ", "quadfat: ", "quadfit: field required"),
        ("mmperpixel: 0.02", "mmperpixel: 0", "mmperpixel: input should be greater"),
        ("width: 96", "width: wide", "width: input should be a valid integer"),
        ("width: 96", "width: 96.5", "width: input should be a valid integer"),
        ("width: 96", "width: 1000000", "1000000 x 64 px are no frame of a camera"),
        ("black: [0.06", "black: [9", "black\\[0\\]: input should be less than 1"),
        ("scale: ", "scale: []\n    x: ", "flatfield.scale: list should have at least 1 item"),
        ("black: ", "black: []\nx: ", "black: list should have at least 1 item"),
        ("scale: [0.4", "scale: [0", "flatfield.scale\\[0\\]: input should be greater than 0"),
    ],
)
def test_a_damaged_model_is_refused(model_file: Path, old: str, new: str, message: str) -> None:
    model_file.write_text(model_file.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_light_model(file=model_file)


@pytest.mark.parametrize("name", ["gone.yaml", "g" * 300])
def test_a_scan_without_its_model_names_the_missing_file(scan: Path, name: str) -> None:
    scan.write_text(scan.read_text().replace('""', name))
    with pytest.raises(InputError, match=rf"light model {name} is not there; give it as `file`="):
        read_light_model(file=scan.parent)


def test_a_crop_beyond_the_frame_is_refused(model_file: Path) -> None:
    for crop, message in (((-1, 0, 9, 9), "holds no pixel"), ((0, 0, 99, 9), "has only 96 x 64")):
        with pytest.raises(InputError, match=message):
            read_light_model(file=model_file, crop=crop)


def test_images_outside_the_scan_are_refused(scan: Path) -> None:
    scan.write_text(scan.read_text().replace("image07.png", "../image07.png"))
    with pytest.raises(InputError, match="must be the name of a file beside"):
        list(read_capture(folder=scan.parent))


def test_every_model_of_real_sensors_is_read() -> None:
    scans = real_data("gelsight_scans")
    for file in ("oem/demo-calibration", "handheld/model-test1", "finger/finger-model"):
        found = read_light_model(file=scans / f"{file}.yaml")
        assert 0.001 < found.pixel_size < 0.1
    series = read_light_model(file=scans / "devices" / "series2_2EF6_4JNW.yaml").model
    assert series.degree == 2
    assert series.gain.shape == (6, 2056, 2464)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty"),
        ("images: [a.png, a.png, b.png]\n", "names a file twice"),
        ("images: [a.png]\nmmperpixel: -1\n", "mmperpixel: input should be greater"),
        ("images: [a.png]\nmmperpixel: 1e-30\n", "mmperpixel: input should be greater"),
        ("images: [a.png]\nmmperpixel: []\n", "mmperpixel: input should be a valid number"),
        ("images: [a.png]\nannotations: [5, {type: GridCircle}]\n", r"\[1\].gx: field required"),
        ("images: [a.png]\nannotations: 5\n", "annotations: input should be a valid list"),
        ("images: [a\0.png]\n", "is not a text file"),
    ],
)
def test_a_scan_file_that_cannot_be_meant_is_refused(
    tmp_path: Path, content: str, message: str
) -> None:
    (tmp_path / "scan.yaml").write_text(content)
    with pytest.raises(InputError, match=message):
        read_scan(tmp_path)


@pytest.mark.parametrize(
    ("target", "mark", "message"),
    [
        ("target: {type: bga, radius: 0.18, pitch: 1}\n", 9, ""),
        ("target: {type: bga, radius: 0.18, pitch: 1}\n", 12, "marked with a radius of 12 px"),
        ("", 9, "the ball's radius is not known"),
    ],
)
def test_a_scan_says_how_large_its_balls_are(
    scan: Path, target: str, mark: int, message: str
) -> None:
    scan.write_text(scan.read_text().replace("r: 9", f"r: {mark}") + target)
    messages: list[str] = []
    try:
        with collect_warnings(messages):
            assert read_balls(folder=scan.parent).radius == pytest.approx(0.18)
    except InputError as error:
        messages.append(str(error))
    assert any(message in each for each in messages) if message else not messages
