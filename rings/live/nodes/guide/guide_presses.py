"""Guide a person through a calibration: the untouched film, then ball after ball."""

from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Interval

from tactograph.rings.frames.colour_planes import in_levels
from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import make_film, top_of
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.open_camera import Plane
from tactograph.rings.live.nodes.camera.sensor_kind import pixel_on_film, preset_of
from tactograph.rings.live.nodes.guide._guide_params import GuideParams
from tactograph.rings.live.nodes.guide._watch_film import Watch, film_at_rest, new_folder, tell
from tactograph.rings.live.nodes.touches.sensor import open_rig
from tactograph.rings.live.nodes.touches.touch_stream import Stream
from tactograph.sdk import (
    F4,
    CaptureFile,
    Dark,
    ImageFile,
    InputError,
    Light,
    PixelSize,
    Port,
    SheetLight,
    StatedCircles,
    atomic_files,
    node,
)
from tactograph.sdk.nodes import find_ball, flat_field, read_balls, read_flat

USUAL_LEDS = 4
MAX_PRESS_SATURATED = 0.01
"""Largest share of saturated pixels in a press."""
MIN_CONTACT_PX = 10.0
"""Smallest radius of a contact with enough pixels to fit an LED's light."""


class GuidedPresses(NamedTuple):
    """The P presses so far as from `read_balls`, and the film as from `read_flat`.

    `serial` is the camera's serial number, if it has one.
    """

    image: SheetLight
    first: Light
    radius: Annotated[F4, Port("P", "mm")]
    circles: StatedCircles
    names: list[str]
    pixel_size: PixelSize
    flat: Light
    dark: Dark
    serial: str | None = None


@node(endless=True)
def guide_presses(
    *,
    driver: CameraParams,
    guide: GuideParams,
    port: str | None = None,
    pixel_size_mm: Annotated[float, Gt(0)] | None = None,
    leds: Annotated[int, Interval(ge=3, le=8)] | None = None,
) -> Iterator[GuidedPresses]:
    """Ask for one press after another, and yield all presses so far after each.

    The untouched film is captured under one LED after the other, and with all LEDs off.  A press
    is captured automatically, once the light differs from that of the untouched film and is
    still; no key is needed.  A press that shows no ball is reported and left out.  Instructions
    appear on the terminal at once.

    All images are kept beside `file`, where `calibrate` can read them: for ``cal.npz``
    ``cal_presses/untouched``, ``cal_presses/dark.png``, ``cal_presses/pressed/01`` and so on.

    Parameters
    ----------
    port : serial port of the LED controller, as for `read_camera`; here the LEDs need one
    pixel_size_mm : mm per px on the film; None: the sensor's
    leds : number of LEDs; None: the sensor's, else 4

    Raises
    ------
    InputError
        If the camera or the controller cannot be opened; if the pixel size is not known; if an
        LED stays dark; if the film does not come to rest, or is never pressed; if the folder
        already holds presses.
    """
    folder = new_folder(guide.file)
    pressed = folder / "pressed"
    preset = preset_of(driver.sensor, flashing=True)
    pixel = pixel_on_film(pixel_size_mm, preset)
    leds = leds or (preset.leds if preset else None) or USUAL_LEDS
    size = guide.width_px, guide.height_px
    rig = open_rig(driver, port, size, leds=leds)
    with closing(rig):
        tell("Take everything off the film, and leave it alone.")
        image, black = film_at_rest(rig, driver.full_scale, guide.patience_s)
        _save_film(folder, image, black)
        film = read_flat(image, black=black, folder=folder / "untouched")
        rig.lamps.resume()
        rest = make_film(*film)
        stream = Stream(rig, rest, film.dark, "cycle", driver.full_scale)
        watch = Watch(rest, stream, guide.still_s, guide.patience_s)
        count = 0
        found = partial(_found, driver, film.flat, film.dark, pixel, guide.ball_radius_mm)
        for count, (press, about) in enumerate(watch.presses(found), start=1):
            frames = {frame.led: frame.data for frame in press.new}
            about.bits = driver.bits
            _save_press(pressed / f"{count:02}", frames, about)
            tell(f"Press {count} is taken: let go.")
            image, first, radius, circles, names, *_ = read_balls(folder=pressed)
            presses = GuidedPresses(image, first, radius, circles, names, pixel, *film)
            yield presses._replace(serial=driver.serial or None)
        if not count:
            raise InputError(
                f"the film was not pressed within {guide.patience_s:g} s; press the ball into it "
                "and hold it still, or wait longer with `patience_s`=600"
            )
        tell(f"No press for {guide.patience_s:g} s: that was all.")


def _found(
    driver: CameraParams, flat: Light, dark: Dark, pixel: float, radius_mm: float, press: LiveFrames
) -> CaptureFile:
    """The press's ball, so that it is searched for only once; an error if it cannot be used."""
    full = np.mean([frame.data >= top_of(frame.data, driver.full_scale) for frame in press.new])
    if full > MAX_PRESS_SATURATED:
        raise InputError(f"{full:.0%} of the picture is saturated, expose shorter")
    try:
        ball = find_ball(flat_field(press.image, flat, dark), pixel, radius_mm=radius_mm)
    except InputError:
        raise InputError(f"no ball of radius {radius_mm:g} mm is seen") from None
    if ball.contact < MIN_CONTACT_PX:
        raise InputError(f"the contact is only {2 * ball.contact:.0f} px wide, press deeper")
    at = ball.center.tolist()
    return CaptureFile(ball_radius_mm=radius_mm, ball_center_px=at, ball_contact_px=ball.contact)


def _save_film(folder: Path, image: Light, dark: Dark) -> None:
    """Save means of many frames with 16 bits, because they are finer than the camera's steps."""
    with atomic_files(folder / "untouched") as target:
        for k, plane in enumerate(image, start=1):
            ImageFile(target / f"led{k}.png").write(in_levels(plane))
    with atomic_files(folder) as target:
        ImageFile(target / "dark.png").write(in_levels(dark))


def _save_press(folder: Path, frames: dict[int, Plane], about: CaptureFile) -> None:
    """Save a capture for `read_balls`: the raw frames, and the properties of the ball."""
    with atomic_files(folder) as target:
        for led, data in frames.items():
            ImageFile(target / f"led{led}.png").write(data)
        # JSON is YAML, too.
        (target / "capture.yaml").write_text(about.model_dump_json(exclude_none=True) + "\n")
