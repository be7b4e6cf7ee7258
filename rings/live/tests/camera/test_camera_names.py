"""A camera is named by its serial number, whatever it is plugged into."""

from pathlib import Path

import pytest

from tactograph.graph import InputError
from tactograph.graph.command import run_command
from tactograph.rings.live.nodes.camera import _camera_names
from tactograph.rings.live.nodes.camera._camera_names import device_of, named_cameras
from tactograph.rings.live.nodes.camera.open_camera import check_camera, open_capture


def plug(sysfs: Path, number: int, name: str, serial: str, index: int = 0) -> None:
    """A camera as the kernel shows it: an interface of a USB device."""
    interface = sysfs.parent / "usb" / f"device{serial or number}" / "1.0"
    interface.mkdir(parents=True, exist_ok=True)
    if serial:
        (interface.parent / "serial").write_text(f"{serial}\n")
    entry = sysfs / f"video{number}"
    entry.mkdir(parents=True)
    (entry / "name").write_text(f"{name}\n")
    (entry / "index").write_text(f"{index}\n")
    (entry / "device").symlink_to(interface)


@pytest.fixture
def sysfs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    made = tmp_path / "video4linux"
    plug(made, 10, "Laptop", "")
    plug(made, 2, "GelSight Mini", "28F5K4RR")
    plug(made, 3, "GelSight Mini", "28F5K4RR", index=1)
    plug(made, 4, "DIGIT", "D20001")
    monkeypatch.setattr(_camera_names, "CAMERA_FOLDER", made)
    return made


def test_cameras_have_names_and_serial_numbers(sysfs: Path) -> None:
    assert named_cameras() == [
        ("/dev/video2", "GelSight Mini", "28F5K4RR"),
        ("/dev/video4", "DIGIT", "D20001"),
        ("/dev/video10", "Laptop", ""),
    ]


def test_a_serial_number_names_the_device_that_has_it_now(sysfs: Path) -> None:
    assert device_of("serial:D20001") == "/dev/video4"
    assert device_of("0") == "0"
    with pytest.raises(InputError, match=r"there are 28F5K4RR \(GelSight Mini\), D20001"):
        check_camera("serial:D2")
    assert not open_capture("serial:D2").isOpened()
    with pytest.raises(InputError, match="no camera has this serial number"):
        device_of("serial:")


def test_the_command_lists_them_or_says_that_there_is_none(
    sysfs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_command(["cameras"])
    printed = capsys.readouterr().out
    assert "28F5K4RR" in printed
    assert "/dev/video10" in printed
    monkeypatch.setattr(_camera_names, "CAMERA_FOLDER", sysfs / "none")
    run_command(["cameras"])
    assert "no camera is plugged in" in capsys.readouterr().out
