"""Guide a person through the calibration of a one-shot sensor: the film, then ball after ball."""

import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from tactograph.rings.frames.colour_planes import Order, in_levels, planes_of
from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import make_film
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.open_camera import Plane
from tactograph.rings.live.nodes.camera.sensor_kind import pixel_on_film, preset_of
from tactograph.rings.live.nodes.guide._guide_params import GuideParams
from tactograph.rings.live.nodes.guide._watch_film import Watch, colours_at_rest, new_folder, tell
from tactograph.rings.live.nodes.touches.colour_stream import ColourStream
from tactograph.rings.live.nodes.touches.sensor import open_colour_sensor
from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.find_presses import MIN_PRESSES
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import degree_for
from tactograph.rings.oneshot.nodes.presses.rate_presses import advise, presses_per_cell, rim_slope
from tactograph.sdk import F4, ImageFile, InputError, Light, PixelSize, atomic_files, node
from tactograph.sdk.nodes import find_ball, level_presses, read_flat

REFIT_PRESSES = 10
"""The map is fitted again after at most this many further presses."""


class GuidedColourPresses(NamedTuple):
    """The P presses so far as from `read_presses`, and their circles as from `find_presses`.

    `serial` is the camera's serial number, if it has one.
    """

    image: PressImages
    flat: Light
    names: list[str]
    circle: Circles
    pixel_size: PixelSize
    serial: str | None = None


@node(endless=True)
def guide_colour_presses(
    *,
    driver: CameraParams,
    guide: GuideParams,
    pixel_size_mm: Annotated[float, Gt(0)] | None = None,
    lights: Order = "bgr",
    warm_up_s: Annotated[float, Ge(0)] | None = None,
    presses_at_most: Annotated[int, Ge(MIN_PRESSES)] = 40,
) -> Iterator[GuidedColourPresses]:
    """Ask for one press after another; yield all so far whenever they allow a finer map.

    A press is captured automatically, once the light differs from that of the untouched film
    and is still; no key is needed.  A press that shows no ball is reported and left out.
    Instructions, and where to press next, appear on the terminal at once.

    All images are kept beside `file`, where `calibrate_presses` can read them: for ``mini.npz``
    ``mini_presses/untouched/film.png``, ``mini_presses/pressed/01/frame.png`` and so on.

    Parameters
    ----------
    pixel_size_mm : mm per px on the film; None: the sensor's
    lights : the colours in the calibration's order
    warm_up_s
        How long the LEDs warm up before the film at rest is captured.  None: the sensor's time,
        none for simulated LEDs.
    presses_at_most : number of presses after which no more are asked for

    Returns
    -------
    After 4, 6, 12, 20 and 30 presses, where the degree of the map's polynomials rises, then after
    every 10, and at the end.

    Raises
    ------
    InputError
        If the camera cannot be opened; if the pixel size is not known; if a colour stays dark;
        if the film does not come to rest, or is not pressed 4 times; if the folder already holds
        presses.
    """
    folder = new_folder(guide.file)
    preset = preset_of(driver.sensor, flashing=False)
    pixel = pixel_on_film(pixel_size_mm, preset)
    source = open_colour_sensor(driver, (guide.width_px, guide.height_px))
    with closing(source):
        if warm_up_s is None:
            warm_up_s = preset.warm_up_s if preset is not None and source.table is None else 0.0
        if warm_up_s:
            tell(f"The LEDs warm up for {warm_up_s:g} s.")
            time.sleep(warm_up_s)
        tell("Take everything off the film, and leave it alone.")
        picture = colours_at_rest(source.camera, driver.full_scale, guide.patience_s)
        file = folder / "untouched" / "film.png"
        _save(file, in_levels(picture))
        flat = read_flat(planes_of(picture, lights), folder=file, lights=lights).flat
        film = make_film(flat)
        stream = ColourStream(source, film, lights, driver.full_scale)
        watch = Watch(film, stream, guide.still_s, guide.patience_s)
        circle_in = partial(_circle, flat=flat, pixel=pixel, radius_mm=guide.ball_radius_mm)
        presses = islice(watch.presses(circle_in), presses_at_most)
        for pressed in _finer_and_finer(presses, folder, flat, guide, pixel):
            yield pressed._replace(serial=driver.serial or None)


def _finer_and_finer(
    presses: Iterator[tuple[LiveFrames, F4]],
    folder: Path,
    flat: Light,
    guide: GuideParams,
    pixel: float,
) -> Iterator[GuidedColourPresses]:
    """Save every press, say where to press next, and yield all whenever a finer map is due."""
    images: list[F4] = []
    circles: list[F4] = []
    fitted = 0
    for press, circle in presses:
        images.append(press.image)
        circles.append(circle)
        _save(folder / "pressed" / f"{len(images):02}" / "frame.png", press.new[-1].data)
        every, size = np.array(circles), (flat.shape[1], flat.shape[2])
        steepest = rim_slope(every, guide.ball_radius_mm / pixel)
        advice = advise(presses_per_cell(every, size), size, steepest)
        tell(f"Press {len(images)} is taken: let go. Next: {advice}.")
        if _is_finer(len(images), fitted):
            fitted = len(images)
            yield _all(images, flat, circles, pixel)
    if len(images) < MIN_PRESSES:
        raise InputError(
            f"the film was pressed {len(images)} times within {guide.patience_s:g} s, and "
            f"{MIN_PRESSES} presses are needed; hold the ball still in it, or wait longer with "
            "`patience_s`=600"
        )
    if fitted < len(images):
        yield _all(images, flat, circles, pixel)


def _circle(press: LiveFrames, flat: Light, pixel: float, radius_mm: float) -> F4:
    """x, y and contact radius in px; raises an error if there is no ball."""
    (level,) = level_presses(press.image[None], flat)
    share = level / np.maximum(flat, np.float32(0.02))
    try:
        ball = find_ball(share, pixel, radius_mm=radius_mm)
    except InputError:
        raise InputError(f"no ball of radius {radius_mm:g} mm is seen") from None
    return np.array([*ball.center, ball.contact], np.float32)


def _is_finer(presses: int, before: int) -> bool:
    """Tell if `presses` allow a finer map than `before`, or are at least `REFIT_PRESSES` more."""
    if presses < MIN_PRESSES:
        return False
    return (
        degree_for(presses) > degree_for(before) or presses >= before + REFIT_PRESSES or not before
    )


def _all(images: list[F4], flat: Light, circles: list[F4], pixel: float) -> GuidedColourPresses:
    names = [f"{i:02}" for i in range(1, len(images) + 1)]
    return GuidedColourPresses(np.stack(images), flat, names, np.stack(circles), pixel)


def _save(file: Path, picture: Plane) -> None:
    with atomic_files(file.parent) as target:
        ImageFile(target / file.name).write(picture)
