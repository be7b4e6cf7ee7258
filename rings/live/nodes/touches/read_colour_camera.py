"""Read touches from the camera of a one-shot sensor, whose colours are lit at once."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Gt, Interval

from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.sensor_kind import preset_of
from tactograph.rings.live.nodes.touches.colour_stream import ColourStream
from tactograph.rings.live.nodes.touches.sensor import open_colour_sensor
from tactograph.sdk import InputError, LiveFrames, LiveState, node
from tactograph.sdk.unstable import Order, UsedCalibration, calibrated_film, make_film


@node(endless=True)
def read_colour_camera(
    *,
    driver: CameraParams,
    used: UsedCalibration,
    lights: Order | None = None,
    queue: Annotated[int, Interval(ge=1, le=64)] = 8,
    seconds: Annotated[float, Gt(0)] | None = None,
    items: Annotated[int, Ge(1)] | None = None,
) -> Iterator[LiveFrames]:
    """Yield every colour frame as a touch, for as long as the camera runs.

    Frames that are saturated, dark or doubled are counted, reported and discarded.  The camera is
    reopened whenever it fails.

    Parameters
    ----------
    lights
        "bgr" or "rgb": the colours that are the lights, in the calibration's order.  None: that
        of `sensor`, else "bgr".
    queue
        Most frames that wait; when the reconstruction is slower than the camera, the oldest
        are dropped.
    seconds, items : time, or number of touches, after which to end; None: never

    Returns
    -------
    Touches as `read_camera` yields them.

    Raises
    ------
    InputError
        If at the start the calibration or the camera cannot be opened, or the camera's image
        size or serial number differs from the calibration's; if there is no such sensor, its
        colours are in another order, or the calibration is not of three lights.
    """
    flat, dark, _ = calibrated_film(used.calibration)
    driver.check_calibration(used)
    height, width = dark.shape
    preset = preset_of(driver.sensor, flashing=False)
    order = lights or (preset.lights if preset else "bgr")
    if preset is not None and order != preset.lights:
        raise InputError(
            f"`sensor`={driver.sensor}: counts the colours as {preset.lights}, but `lights`={order}"
        )
    if len(flat) != len(order):
        raise InputError(
            f"{used.calibration}: is of {len(flat)} LEDs, but a colour picture holds {len(order)} "
            "lights; LEDs that flash are read by 'op: read_camera'"
        )
    camera = open_colour_sensor(
        driver,
        (width, height),
        preset=preset,
        queue=queue,
        calibration=used.calibration,
        order=order,
    )
    with closing(camera):
        state = LiveState(settings=driver.noted | {"lights": order})
        stream = ColourStream(camera, make_film(flat, dark), order, driver.full_scale, state)
        yield from stream.touches(driver.timeout_s / 2, seconds, items)


@read_colour_camera.rehearsal
def _rehearsal(*, calibration: Path, **_: Any) -> LiveFrames:
    """Return the film at rest."""
    return calibrated_film(calibration).touch
