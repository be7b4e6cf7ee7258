"""A capture becomes a scan that its own reader, and GelSight's tools, take."""

from pathlib import Path

import numpy as np
import pytest

from rings.metrology.tests.scan.scans import PIXEL, cap, seen, write_model, write_scan as made_scan
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.files.height_files import HeightFile
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model
from tactograph.rings.metrology.nodes.scan.scan_file import read_scan
from tactograph.rings.metrology.nodes.scan.write_scan import write_scan


def test_an_exported_scan_is_read_back(tmp_path: Path) -> None:
    model = write_model(tmp_path / "model: 1.yaml")
    made_scan(tmp_path / "first", seen(cap(), model))
    np.save(tmp_path / "height.npy", cap())
    arguments = {
        "capture": tmp_path / "first",
        "height": tmp_path / "height.npy",
        "model": "model: 1.yaml",
        "out": tmp_path / "second",
    }
    assert list(open_pipeline("export_scan_height", arguments).items())
    (first,), (second,) = (read_capture(folder=tmp_path / name) for name in ("first", "second"))
    np.testing.assert_allclose(second.image, first.image, atol=1e-6)
    assert second.pixel_size == PIXEL
    np.testing.assert_allclose(
        HeightFile.read(tmp_path / "second" / "heightmap.tmd").height, cap(), atol=1e-6
    )
    assert read_light_model(file=tmp_path / "second").model.gain is not None
    marks, again = (read_scan(tmp_path / name).balls for name in ("first", "second"))
    assert marks == again != []
    HeightFile(cap(), 2 * PIXEL).write(tmp_path / "height.tiff")
    arguments |= {"height": tmp_path / "height.tiff", "out": tmp_path / "third"}
    (doubted,) = open_pipeline("export_scan_height", arguments).items()
    assert any("mm per px, but" in warning for warning in doubted.warnings)


def test_balls_are_marked_where_a_crop_moves_them(tmp_path: Path) -> None:
    made_scan(tmp_path / "touches/marked", np.full((4, 40, 60), 0.5, np.float32))
    captured = tmp_path / "touches/ours"
    write_scan(np.full((4, 40, 60), 0.5, np.float32), PIXEL, folder=captured)
    (captured / "scan.yaml").unlink()
    about = "ball_radius_mm: 0.1\nball_center_px: [20, 15.5]\n"
    (captured / "capture.yaml").write_text(about)
    arguments = {"capture": captured.parent, "pixel_size_mm": PIXEL, "crop": (10, 5, 60, 40)}
    list(open_pipeline("export_scan", {**arguments, "out": tmp_path / "out"}).items())
    marked, ours = (read_scan(tmp_path / "out" / name) for name in ("marked", "ours"))
    assert marked.balls == ((1, -2, 20.5, 15, 9),)
    assert ours.balls == ((0, 0, 10, 10.5, pytest.approx(0.1 / PIXEL)),)
    assert ours.ball_radius == 0.1


def test_images_of_8_bits_stay_so(tmp_path: Path) -> None:
    image = (100 + np.arange(64, dtype=np.float32).reshape(4, 4, 4)) / np.float32(255)
    write_scan(image, 0.01, folder=tmp_path)
    (capture,) = read_capture(folder=tmp_path)
    np.testing.assert_array_equal(capture.image, image)
    assert (tmp_path / "image01.png").stat().st_size < 100
