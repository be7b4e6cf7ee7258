"""A calibrated sensor that a ball presses: its images are rendered through its own calibration."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qsl

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.calibrated_film import calibrated_film
from tactograph.rings.frames.colour_planes import Order, in_bytes
from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    RECENT_FRAMES,
    Scene,
    SimulatedSensor,
    read_scene,
)
from tactograph.sdk import F4, FileKind, load

PRESS_FIELDS = {
    *("radius_mm", "depth_mm", "path_mm", "period_s", "press_s", "by_hand", "rest_s"),
    *("exposure_s", "readout_s", "seed"),
}
"""What a scene may state of a sensor that is calibrated; all else is a rig of its own."""


class _Rendered(NamedTuple):
    """The images of all lights, K x H x W, and the height that the camera sees, H x W in mm."""

    image: F4
    height: F4


class CalibratedSensor(SimulatedSensor):
    """A sensor as its calibration has it, flashed or one-shot, by the graph ``see_touch``.

    A camera does not wait for the graph: the film moves on whenever a thread has rendered it.
    """

    def __init__(self, scene: Scene, calibration: Path, order: Order = "bgr") -> None:
        super().__init__(scene)
        flat, self._black, one_shot = calibrated_film(calibration)
        self.strength = np.ones(len(flat), np.float32)
        self._to_driver = 1 if order == "bgr" else -1
        self._worker = ThreadPoolExecutor(1, "simulated sensor")
        self._graph = "see_touch_oneshot" if one_shot else "see_touch"
        self._calibration = calibration
        self._pipeline: Callable[..., Any] | None = None
        self._latest = self._worker.submit(self._see, self.start).result()
        self._coming: Future[_Rendered] = self._worker.submit(self._see, self.start)
        self._by_moment: dict[float, _Rendered] = {}
        self.start = time.monotonic()

    def true_height(self, moment: float) -> F4:
        """The height that the frame nearest to a time shows, H x W in mm."""
        nearest = min(self._by_moment, key=lambda each: abs(each - moment), default=None)
        return self._latest.height if nearest is None else self._by_moment[nearest].height

    def image(self, shares: Any, moment: float, number: int) -> NDArray[np.uint8]:
        """The camera's image under flashing LEDs; see `SimulatedSensor.image`."""
        weights = np.array(shares) * self.strength[:, None]
        light = weights[..., None] * (self._at(moment).image - self._black)
        return in_bytes(self._black + light.sum(axis=0))

    def picture(self, moment: float, number: int) -> NDArray[np.uint8]:
        """The colour camera's picture, H x W x 3."""
        # A picture that comes twice to the bit would be taken for one frame.
        self._coming.result()
        image = in_bytes(self._at(moment).image[:: self._to_driver])
        return np.ascontiguousarray(np.moveaxis(image, 0, -1))

    def _at(self, moment: float) -> _Rendered:
        """The newest film that is rendered; the next begins."""
        if self._coming.done():
            self._latest = self._coming.result()
            self._coming = self._worker.submit(self._see, moment)
        self._by_moment = dict([*self._by_moment.items()][-RECENT_FRAMES:]) | {moment: self._latest}
        return self._latest

    def _see(self, moment: float) -> _Rendered:
        """Render the film; a pipeline belongs to one thread."""
        if self._pipeline is None:
            outputs = "image", "height"
            self._pipeline = load(self._graph, calibration=self._calibration, outputs=outputs)
        rendered = self._pipeline(height=super().true_height(moment))
        return _Rendered(rendered["image"].copy(), rendered["height"].copy())


def calibrated_sensor(
    camera: str, calibration: Path, order: Order = "bgr"
) -> CalibratedSensor | None:
    """The sensor of a calibration; None if the camera's scene states a rig of its own.

    The ball and its way are to the film as in the default scene, where they are not stated.
    """
    if {name for name, _ in parse_qsl(camera.partition("?")[2])} - PRESS_FIELDS:
        return None
    sensor, default = FileKind.read_sensor(calibration), Scene()
    pixel, (height, width) = float(sensor.pixel_size), sensor.flat.shape[1:]
    scale = min(height, width) * pixel / (default.height_px * default.pixel_size_mm)
    film = {"width_px": width, "height_px": height, "pixel_size_mm": pixel}
    for name in ("radius_mm", "depth_mm", "path_mm"):
        film[name] = scale * getattr(default, name)
    return CalibratedSensor(read_scene(camera, Scene, film), calibration, order)
