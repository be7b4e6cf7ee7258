"""A simulated one-shot sensor: three coloured LEDs beside the film, lit at once, as in a Mini."""

from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass as checked_dataclass

from tactograph.rings.live.nodes.simulated.simulated_sensor import Scene, SimulatedSensor
from tactograph.sdk import LightPositions
from tactograph.sdk.nodes import light_ring

COLOUR_COUNT = 3
"""Blue, green, red: the order of a camera's driver."""
FIRST_AZIMUTH_DEG = -90.0
"""The blue LED is above the picture."""
FILM_LIGHT = 0.55
"""Largest light of the film at rest; film that faces an LED is half as bright again."""
FADING_PACES = np.array([1.0, 2.0, 0.5])
"""Relative speeds of the LEDs' warm-up."""


@checked_dataclass(frozen=True, config={"extra": "forbid"})
class ColourScene(Scene):
    """A one-shot sensor and the ball that presses it; defaults are a GelSight Mini's size.

    `diffuse` is the share of each LED's light that the gel diffuses.  `crosstalk` is what each
    of two colours adds to the third in the camera.  `warm_up` is the LEDs' relative excess at the
    start, which decays with `warm_s`: in green twice as fast as in blue, in red half as fast.
    """

    width_px: Annotated[int, Interval(ge=8, le=4096)] = 320
    height_px: Annotated[int, Interval(ge=8, le=4096)] = 240
    pixel_size_mm: Annotated[float, Interval(gt=0)] = 0.0634
    slant_deg: Annotated[float, Interval(ge=0, lt=90)] = 50.0
    distance_mm: Annotated[float, Interval(gt=0)] = 20.0
    radius_mm: Annotated[float, Interval(gt=0)] = 3.155
    depth_mm: Annotated[float, Interval(ge=0)] = 0.7
    diffuse: Annotated[float, Interval(ge=0, le=1)] = 0.3
    crosstalk: Annotated[float, Interval(ge=0, lt=0.5)] = 0.1
    warm_up: Annotated[float, Interval(ge=0, le=1)] = 0.0
    warm_s: Annotated[float, Interval(gt=0)] = 60.0

    @property
    def lights(self) -> LightPositions:
        """LED positions: around the film, a third of a turn apart."""
        return light_ring(
            count=COLOUR_COUNT,
            slant_deg=self.slant_deg,
            distance_mm=self.distance_mm,
            first_azimuth_deg=FIRST_AZIMUTH_DEG,
        )


class SimulatedColourSensor(SimulatedSensor):
    """Film, coloured LEDs and ball."""

    scene: ColourScene

    def __init__(self, scene: ColourScene, start: float | None = None) -> None:
        super().__init__(scene, start)
        # Share of each LED in each of the camera's channels.
        self._mix = np.full((COLOUR_COUNT, COLOUR_COUNT), scene.crosstalk, np.float32)
        np.fill_diagonal(self._mix, 1 - (COLOUR_COUNT - 1) * scene.crosstalk)
        self._bare *= np.float32(FILM_LIGHT / float(self._bare.max()))

    def picture(self, moment: float, number: int) -> NDArray[np.uint8]:
        """The camera's picture at a time: H x W x 3; `number` selects the noise."""
        # The LEDs' brightness, 1 when warm.
        pace = FADING_PACES * max(moment - self.start, 0.0) / self.scene.warm_s
        warmth = self.strength * (1 + self.scene.warm_up * np.exp(-pace))
        light = np.stack([self._light(k, moment) for k in range(COLOUR_COUNT)])
        diffused = self._bare * self._film(moment).bright
        light += np.float32(self.scene.diffuse) * (diffused - light)
        light *= np.asarray(warmth, np.float32)[:, None, None]
        channels = np.tensordot(self._mix, light, axes=1)
        developed = [self._recorded(plane, number + c) for c, plane in enumerate(channels)]
        return np.stack(developed, axis=-1)
