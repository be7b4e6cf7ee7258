"""Read touches from a camera whose LEDs flash in turn, or are lit at once in several colours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval

from tactograph.graph import FRACTIONS, InputError, Whole, node
from tactograph.nodes.calibrate.file.calibrated_film import calibrated_film
from tactograph.nodes.files.image_files import Lights
from tactograph.nodes.files.sensor_preset import read_preset
from tactograph.nodes.live.camera.open_camera import CameraSettings, Library
from tactograph.nodes.live.touches.colour_stream import ColourStream, open_colour_sensor
from tactograph.nodes.live.touches.sensor import open_sensor
from tactograph.nodes.live.touches.touch_stream import Stream
from tactograph.nodes.stream.assemble import Refresh
from tactograph.nodes.stream.frames import LiveState, Touch
from tactograph.nodes.stream.led_in_frame import make_film


@node(endless=True)
def read_camera(
    *,
    camera: int | str = 0,
    sensor: str | None = None,
    library: Library = "opencv",
    port: str | None = None,
    calibration: Path,
    rate: Annotated[float, Gt(0)] = 30.0,
    exposure: float | None = None,
    gain: float | None = None,
    white_balance: float | None = None,
    lights: Lights | None = None,
    refresh: Refresh = "rolling",
    ambient: bool = False,
    motion: Literal["report", "skip"] = "report",
    motion_limit: Annotated[float, Gt(0)] = 0.1,
    bits: Annotated[int, Interval(ge=8, le=16)] | None = None,
    queue: Annotated[int, Interval(ge=1, le=64)] = 8,
    timeout_s: Annotated[float, Interval(gt=0, le=10)] = 0.5,
    seconds: Annotated[float, Gt(0)] | None = None,
    items: Annotated[int, Ge(1)] | None = None,
    whole: Whole = FRACTIONS,
) -> Iterator[Touch]:
    """Yield a touch with every camera frame, for as long as the camera runs.

    A frame is matched to its LED by its image, which shows the film at rest under one of the
    LEDs, and by the controller's clock; both must agree.  Frames that show two LEDs, none, the
    wrong one, or not the film at all are counted, reported and discarded.  Camera and controller
    are reopened whenever they fail.

    With a one-shot sensor, whose LEDs have different colours and are lit at once, every colour
    frame is a touch.  It has no controller and ignores `port`, `refresh`, `ambient` and `motion`.

    Parameters
    ----------
    camera
        Index, serial number (``serial:28F5K4RR``, see ``tactograph cameras``; of an industrial
        camera ``genicam:28F5K4RR``), device (``/dev/v4l/by-id/...``), URL or video file;
        ``simulated`` for a simulated sensor, with its scene behind a question mark:
        ``simulated?radius_mm=3&depth_mm=0.5``.
    sensor
        A one-shot sensor's kind, "gelsight_mini" or "digit", or a file of your own.  It gives
        the camera's settings, how its pictures are rotated, cropped and scaled down, and the
        order of its colours.  Start from a copy of ``nodes/files/sensors/gelsight_mini.yaml``.
    library
        "opencv" opens the camera.  "linuxpy" (Linux only) adds the kernel's time and number of
        each frame, and all bits of grey frames (``pip install 'tactograph[linux]'``).
    port
        The LED controller's serial port.  None: found by its USB id.  ``simulated``: a
        software controller.  ``none``: the LEDs flash by themselves, and the image alone
        decides.
    calibration
        The sensor's calibration; its flat frame shows the film at rest.
    rate
        Frames per second, and steps of the LEDs per second.
    lights
        "leds": they flash.  "bgr" or "rgb": the colours of a frame are the lights, in the
        calibration's order.  None: "bgr" if the calibration is a one-shot sensor's
        (`write_press_calibration`), else "leds".
    exposure, gain, white_balance
        In the driver's units; None keeps the driver's values.  Automatic control is turned off.
    refresh
        "rolling": a touch with every frame, which replaces the older one of its LED.  "cycle":
        a touch whenever all LEDs are new.
    ambient
        Whether the cycle has a step with all LEDs off, whose light is subtracted.
    motion, motion_limit
        A touch whose light changes by more than the limit (1 is the film at rest) from one
        cycle to the next is counted as "moved", or skipped.
    bits
        Bit depth, if the camera uses fewer bits than its 16-bit frames hold.
    queue
        Most frames that wait; when the reconstruction is slower than the camera, the oldest
        are dropped.
    timeout_s
        Time without a frame after which the camera is reopened.
    seconds, items
        Time, or number of touches, after which to end.  None: never.
    whole
        Whether frames of flashing LEDs may remain the camera's integers.

    Returns
    -------
    Touches: the light K x H x W as fractions of full scale, a running number as name, the end
    of the newest exposure in s of ``time.monotonic()``, the new frames, the counters so far,
    and the true height if the sensor is simulated.

    Raises
    ------
    InputError
        If at the start the calibration, the camera or the controller cannot be opened, or the
        camera's image size differs from the calibration's; if there is no such sensor.
    """
    flat, dark, one_shot = calibrated_film(calibration)
    height, width = dark.shape
    preset = None if sensor is None else read_preset(sensor)
    order = lights or (preset.lights if preset else "bgr" if one_shot else "leds")
    if preset is not None and order != preset.lights:
        raise InputError(
            f"sensor={sensor}: counts the colours as {preset.lights}, but lights={order}"
        )
    if order != "leds" and len(flat) != len(order):
        raise InputError(
            f"{calibration}: is of {len(flat)} LEDs, but a colour picture holds {len(order)} "
            "lights; leave lights= and sensor= out for LEDs that flash"
        )
    wanted = CameraSettings(
        width, height, rate, exposure, gain, white_balance, colour=order != "leds"
    )
    full = float(2**bits - 1) if bits else 0.0
    settings: dict[str, Any] = {
        "camera": str(camera),
        "sensor": sensor,
        "library": library,
        "rate": rate,
        "exposure": exposure,
        "gain": gain,
        "white_balance": white_balance,
        "bits": bits,
        "lights": order,
    }
    with ExitStack() as closing:
        if order == "leds":
            flashed = open_sensor(
                camera,
                port,
                flat,
                dark,
                wanted,
                ambient=ambient,
                library=library,
                queue=queue,
                timeout=timeout_s,
            )
            closing.callback(flashed.close)
            settings |= {"refresh": refresh, "cycle": list(flashed.cycle)}
            state, skip = LiveState(settings=settings), motion == "skip"
            stream: Stream | ColourStream = Stream(
                flashed, refresh, full, whole, motion_limit, skip, state
            )
        else:
            colours = open_colour_sensor(
                camera, wanted, preset=preset, library=library, queue=queue, timeout=timeout_s
            )
            closing.callback(colours.close)
            film = make_film(flat, dark)
            stream = ColourStream(colours, film, order, full, LiveState(settings=settings))
        yield from stream.touches(timeout_s / 2, seconds, items)


@read_camera.rehearsal
def _rehearsal(
    *,
    calibration: Path,
    lights: Lights | None,
    ambient: bool,
    bits: int | None,
    whole: bool,
    **_: Any,
) -> Touch:
    """The film at rest from the calibration, in the pixel type that most cameras deliver."""
    film = calibrated_film(calibration)
    flashes = (lights or ("bgr" if film.one_shot else "leds")) == "leds"
    if not (whole and flashes) or ambient or bits is not None:
        return film.touch
    image: Any = np.rint(np.clip(film.touch.image, 0, 1) * 255).astype(np.uint8)
    return film.touch._replace(image=image)
