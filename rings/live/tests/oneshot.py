"""A simulated one-shot sensor, and presses of its ball without waiting for them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactograph.graph import Provenance
from tactograph.nodes.calibrate.ranks.rank_checks import rank_checks
from tactograph.rings.frames.colour_planes import planes_of
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_sensor import read_scene
from tactograph.rings.oneshot.nodes.file.write_press_calibration import write_press_calibration
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import fit_reflectance_map
from tactograph.rings.oneshot.nodes.presses.level_presses import level_presses

PIXEL_MM, BALL_MM = 0.2, 3.0
RIG = (
    f"width_px=96&height_px=72&pixel_size_mm={PIXEL_MM}&radius_mm={BALL_MM}&depth_mm=0.8"
    "&full_well=150000"
)
"""So small a picture has no pixels to average noise over."""
BY_HAND = f"simulated?{RIG}&by_hand=true&path_mm=8&press_s=0.8&rest_s=4"
MOVING = f"simulated?{RIG}&path_mm=2&press_s=4&period_s=12"


TOUCHING = 0.84
"""The contact's radius over that of a ball in a film that does not bend: it lifts the rim."""


class Pressed(NamedTuple):
    """The film at rest, frames of presses (H x W x 3), and their contacts' x, y, radius in px."""

    film: np.ndarray
    frames: list[np.ndarray]
    circles: np.ndarray


def pressed(presses: int) -> Pressed:
    sensor = SimulatedColourSensor(read_scene(BY_HAND, ColourScene), start=0.0)
    scene = sensor.scene
    held = [scene.rest_s + (i + 0.3) * scene.press_s for i in range(presses)]
    film = np.mean([sensor.picture(0.0, n) for n in range(8)], axis=0)
    places = np.array([sensor.place(moment) for moment in held])
    middle = np.array([scene.width_px - 1, scene.height_px - 1]) / 2
    contact = TOUCHING * np.sqrt(2 * scene.radius_mm * scene.depth_mm - scene.depth_mm**2)
    radius = np.full((presses, 1), contact / PIXEL_MM)
    circles = np.hstack([places[:, :2] / PIXEL_MM + middle, radius]).astype(np.float32)
    return Pressed(film, [sensor.picture(t, i) for i, t in enumerate(held)], circles)


def calibrated(file: Path) -> None:
    """Write the sensor's calibration; where the ball is needs no search here."""
    film, frames, circles = pressed(12)
    flat = planes_of(film.astype(np.float32), "bgr", 255)
    image = level_presses(np.stack([planes_of(frame, "bgr", 255) for frame in frames]), flat)
    names = [str(i) for i in range(len(frames))]
    fit = fit_reflectance_map(image, flat, names, circles, PIXEL_MM, radius_mm=BALL_MM)
    made = Provenance({}, None, [], {}, {}, [], [])
    quality = {"residual_percent": 100 * float(fit.residual.max())}
    write_press_calibration(
        flat, PIXEL_MM, fit.reflectance, quality, "", file=file, provenance=made
    )
    rank_checks(file=file)
