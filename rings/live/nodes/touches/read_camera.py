"""Read touches from a running camera, whose LEDs flash in turn or are all lit at once."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval

from tactograph.rings.frames.assemble import Refresh
from tactograph.rings.frames.calibrated_film import calibrated_film
from tactograph.rings.frames.colour_planes import Order
from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import RestFilm, make_film
from tactograph.rings.live.nodes.camera.camera_params import CameraParams, UsedCalibration
from tactograph.rings.live.nodes.camera.sensor_kind import preset_of
from tactograph.rings.live.nodes.touches.colour_stream import ColourStream
from tactograph.rings.live.nodes.touches.sensor import open_colour_sensor, open_rig
from tactograph.rings.live.nodes.touches.touch_stream import Stream
from tactograph.sdk import InputError, KeepIntegers, LiveState, SensorIdentity, node


@node(endless=True)
def read_camera(
    *,
    driver: CameraParams,
    port: str | None = None,
    used: UsedCalibration,
    lights: Order | None = None,
    refresh: Refresh = "rolling",
    ambient: bool = False,
    motion: Literal["report", "skip"] = "report",
    motion_limit: Annotated[float, Gt(0)] = 0.1,
    queue: Annotated[int, Interval(ge=1, le=64)] = 8,
    seconds: Annotated[float, Gt(0)] | None = None,
    items: Annotated[int, Ge(1)] | None = None,
    integers: KeepIntegers = False,
) -> Iterator[LiveFrames]:
    """Yield a touch with every camera frame, for as long as the camera runs.

    A frame is matched to its LED by its image, which shows the film at rest under one of the
    LEDs, and by the controller's clock; both must agree.  Frames that show two LEDs, none, the
    wrong one, or not the film at all are counted, reported and discarded.  Camera and controller
    are reopened whenever they fail.  Of a one-shot sensor every colour frame is a touch.

    Parameters
    ----------
    port
        The LED controller's serial port.  None: found by its USB id.  ``simulated``: a
        software controller.  ``none``: the LEDs flash by themselves, and the image alone
        decides.
    lights
        Of colours that are lit at once: the order in which the calibration counts them.  None:
        that of `sensor`, else "bgr", for a calibration of a one-shot sensor; LEDs that flash for
        any other.
    refresh
        "rolling": a touch with every frame, which replaces the older one of its LED.  "cycle":
        a touch whenever all LEDs are new.
    ambient : whether the cycle has a step with all LEDs off, whose light is subtracted
    motion, motion_limit
        A touch whose light changes by more than the limit (1 is the film at rest) from one
        cycle to the next is counted as "moved", or skipped.
    queue
        Most frames that wait; when the reconstruction is slower than the camera, the oldest
        are dropped.
    seconds, items : time, or number of touches, after which to end; None: never
    integers : whether frames may remain the camera's integers

    Returns
    -------
    Touches: the light K x H x W as fractions of full scale, a running number as name, the end
    of the newest exposure in s of ``time.monotonic()``, the new frames, the counters so far,
    and the true height if the sensor is simulated.

    Raises
    ------
    InputError
        If at the start the calibration, the camera or the controller cannot be opened, or the
        camera's image size or serial number differs from the calibration's; if `sensor` is of the
        other kind, counts its colours in another order, or the calibration is not of three
        colours; at the end, if no frame could be used.
    """
    flat, dark, one_shot = calibrated_film(used.calibration)
    driver.check_calibration(used)
    film = make_film(flat, dark)
    stream: Stream | ColourStream
    if one_shot or lights is not None:
        stream = _colour_stream(driver, used.calibration, film, lights, queue)
    else:
        rig = open_rig(
            driver,
            port,
            (film.size[1], film.size[0]),
            leds=len(flat),
            ambient=ambient,
            queue=queue,
            calibration=used.calibration,
        )
        cycle = {"lights": "leds", "refresh": refresh, "cycle": list(rig.cycle)}
        stream = Stream(
            rig,
            film,
            dark,
            refresh,
            driver.full_scale,
            integers,
            motion_limit,
            motion == "skip",
            LiveState(settings=driver.stored | cycle),
        )
    with closing(stream.sensor):
        yield from stream.touches(driver.timeout_s / 2, seconds, items)
    if stream.state.frames and not stream.state.touches:
        owner = SensorIdentity.in_words(used.calibration)
        raise InputError(
            f"`camera`={driver.camera}: none of {stream.state.frames} frames could be used (see "
            f"the warnings); check that this is the calibrated sensor: {owner}"
        )


def _colour_stream(
    driver: CameraParams, calibration: Path, film: RestFilm, lights: Order | None, queue: int
) -> ColourStream:
    """The stream of a sensor whose colours are lit at once."""
    preset = preset_of(driver.sensor, flashing=False)
    order = lights or (preset.lights if preset else "bgr")
    if preset is not None and order != preset.lights:
        raise InputError(
            f"`sensor`={driver.sensor}: counts the colours as {preset.lights}, but `lights`={order}"
        )
    if len(film.patterns) != len(order):
        raise InputError(
            f"{calibration}: is of {len(film.patterns)} LEDs, but a colour picture holds "
            f"{len(order)} lights; leave out `lights` for LEDs that flash"
        )
    height, width = film.size
    sensor = open_colour_sensor(
        driver, (width, height), queue=queue, calibration=calibration, order=order
    )
    state = LiveState(settings=driver.stored | {"lights": order})
    return ColourStream(sensor, film, order, driver.full_scale, state)


@read_camera.rehearsal
def _rehearsal(
    *,
    calibration: Path,
    lights: Order | None,
    ambient: bool,
    bits: int | None,
    integers: bool,
    **_: Any,
) -> LiveFrames:
    """Return the film at rest, in the pixel type that most cameras deliver."""
    film = calibrated_film(calibration)
    touch, is_colour = film.touch, film.one_shot or lights is not None
    if not integers or ambient or bits is not None or is_colour:
        return touch
    image: Any = np.rint(np.clip(touch.image, 0, 1) * 255).astype(np.uint8)
    return touch._replace(image=image)
