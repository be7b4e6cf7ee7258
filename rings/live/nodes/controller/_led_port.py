"""Find the LED controller's port, and explain why a port cannot be opened."""

import errno

import serial
from serial.tools import list_ports

from tactograph.sdk import InputError

USB_IDS = {
    (0x2E8A, 0x0005): "Raspberry Pi Pico with MicroPython",
    (0x2E8A, 0x000A): "Raspberry Pi Pico",
}
"""USB vendor and product of boards that may be an LED controller."""
BAUD_RATE = 115200
"""Rate of a USB-UART converter; a Pico on USB ignores it."""


def find_ports() -> list[str]:
    """Ports whose USB id is that of a possible controller, in order of name."""
    return sorted(p.device for p in list_ports.comports() if (p.vid, p.pid) in USB_IDS)


def open_port(port: str, timeout_s: float) -> serial.SerialBase:
    """Open `port` exclusively; reads wait at most 0.1 s, writes `timeout_s`.

    Raises
    ------
    InputError
        If there is no such port, another program uses it, or permission is missing; if it is a
        URL, because some of them write files.
    """
    if "://" in port:
        raise InputError(f"`port`={port}: is no device; give its name, such as /dev/ttyACM0")
    try:
        return serial.Serial(port, BAUD_RATE, timeout=0.1, write_timeout=timeout_s, exclusive=True)
    except (OSError, ValueError) as error:
        # serial.SerialException is an OSError, and most have an errno.
        raise InputError(_why_not(port, error)) from None


def no_controller() -> InputError:
    """The error for a port that was neither given nor found; it lists the existing ports."""
    names = [
        f"{p.device} ({p.description})" if p.description not in (None, "n/a") else p.device
        for p in sorted(list_ports.comports())
        if p.vid is not None
    ]
    ports = "serial ports on USB: " + ", ".join(names) if names else "no serial port on USB at all"
    hint = "plug it in, or give `port`=NAME (`port`=simulated for a simulated camera)"
    return InputError(f"no LED controller found; {ports}; {hint}")


def _why_not(port: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"{port}: no permission to open it; join its group ('sudo usermod -aG dialout $USER') "
            "and log in again; if it belongs to root, see rings/live/docs/hardware.md"
        )
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"{port}: taken by another program; close that first"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        ports = ", ".join(find_ports())
        hint = f"there is a controller at {ports}" if ports else "is the controller plugged in?"
        return f"{port}: there is no such port; {hint}"
    return f"{port}: cannot be opened: {error}"
