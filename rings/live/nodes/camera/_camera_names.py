"""Cameras by serial number or link, regardless of the order of connection (Linux)."""

import re
from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import InputError

CAMERA_FOLDER = Path("/sys/class/video4linux")
"""Folder in which the kernel lists cameras."""
SERIAL_PREFIX = "serial:"
GENICAM_PREFIX = "genicam:"
DEVICE_FILE = re.compile(r"/dev/video(\d+)")


class NamedCamera(NamedTuple):
    """A connected camera; `serial` is empty if it has none."""

    device: str
    name: str
    serial: str


def named_cameras() -> list[NamedCamera]:
    """The connected cameras, by number, without devices that deliver no pictures (metadata)."""
    cameras = []
    for entry in sorted(CAMERA_FOLDER.glob("video*"), key=lambda each: int(each.name[5:])):
        if _read(entry / "index") not in ("", "0"):
            continue
        interface = (entry / "device").resolve()
        # A USB camera is an interface of a device, which has the serial number.
        serial = _read(interface / "serial") or _read(interface.parent / "serial")
        cameras.append(NamedCamera(f"/dev/{entry.name}", _read(entry / "name"), serial))
    return cameras


def no_such_camera(camera: str, cameras: list[NamedCamera]) -> InputError:
    """Return the error for a serial number that none of the cameras has."""
    others = ", ".join(f"{each.serial} ({each.name})" for each in cameras if each.serial)
    return InputError(
        f"`camera`={camera}: no camera has this serial number; there are {others or 'none'} "
        "('tactograph cameras' lists them)"
    )


def device_of(camera: str) -> str:
    """The present device node of a serial number or of a link such as ``/dev/v4l/by-id/...``.

    Raises
    ------
    InputError
        If no camera has the serial number.
    """
    if camera.startswith(SERIAL_PREFIX):
        serial, cameras = camera.removeprefix(SERIAL_PREFIX), named_cameras()
        for connected in cameras:
            if serial and serial == connected.serial:
                return connected.device
        raise no_such_camera(camera, cameras)
    path = Path(camera)
    return str(path.resolve()) if camera.startswith("/dev/") and path.is_symlink() else camera


def serial_of(camera: str) -> str:
    """The serial number of a camera as users name it; empty if it has none, or is no device."""
    for prefix in (SERIAL_PREFIX, GENICAM_PREFIX):
        if camera.startswith(prefix):
            return camera.removeprefix(prefix)
    device = f"/dev/video{camera}" if camera.isdecimal() else device_of(camera)
    return next((each.serial for each in named_cameras() if each.device == device), "")


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
