"""A simulated one-shot sensor: three coloured LEDs beside the film, lit at once, as in a Mini."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass as checked_dataclass

from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    MAX_BYTE,
    NOISE_IMAGES,
    Scene,
    SimulatedSensor,
)
from tactograph.sdk import F4
from tactograph.sdk.nodes import light_ring
from tactograph.sdk.unstable import LightPositions

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
    """Film, coloured LEDs and ball, with all faults except those of single LEDs."""

    scene: ColourScene

    def __init__(self, scene: ColourScene, start: float | None = None) -> None:
        super().__init__(scene, start)
        # Share of each LED in each of the camera's channels.
        mix = np.full((COLOUR_COUNT, COLOUR_COUNT), scene.crosstalk, np.float32)
        np.fill_diagonal(mix, 1 - (COLOUR_COUNT - 1) * scene.crosstalk)
        scale = np.float32(FILM_LIGHT / float(self._bare.max()))
        self._bare *= scale
        self._flat *= scale
        self._mix = mix
        self._pictures: dict[int, NDArray[np.uint8]] = {}

    def picture(self, moment: float, number: int) -> NDArray[np.uint8]:
        """The camera's picture at a time: H x W x 3; `number` selects the noise."""
        if self.covered:
            return self._developed(np.zeros_like(self._flat), number, ())
        if self.flooded:
            return np.full((*self._lens.shape, COLOUR_COUNT), MAX_BYTE, np.uint8)
        # The LEDs' brightness, 1 when warm.
        pace = FADING_PACES * max(moment - self.start, 0.0) / self.scene.warm_s
        warmth = np.asarray(1 + self.scene.warm_up * np.exp(-pace), np.float32)
        recorded = self._at_rest_all(warmth, number).copy()
        under = [self._pressed_light(k, moment) for k in range(COLOUR_COUNT)]
        part, bright = under[0][1], self._press(moment).bright
        diffuse = np.float32(self.scene.diffuse)
        strength = self.strength[:, None, None]
        light = np.stack([light for light, _ in under]) * (1 - diffuse)
        light += diffuse * strength * self._bare[:, *part] * bright
        recorded[part] = self._developed(light * warmth[:, None, None], number, part)
        return recorded

    def _at_rest_all(self, warmth: F4, number: int) -> NDArray[np.uint8]:
        """The untouched film; computed once per field of noise while the LEDs are steady."""
        strength = (warmth * self.strength)[:, None, None]
        if (strength != 1).any():
            return self._developed(self._flat * strength, number, ())
        key = number % NOISE_IMAGES
        if key not in self._pictures:
            self._pictures[key] = self._developed(self._flat, number, ())
        return self._pictures[key]

    def _developed(self, light: F4, number: int, part: Any) -> NDArray[np.uint8]:
        """The camera's three channels for the LEDs' light, K x H x W, each with its own noise."""
        mixed = np.tensordot(self._mix, light, axes=1)
        channels = [self._recorded(plane, number + c, part) for c, plane in enumerate(mixed)]
        return np.stack(channels, axis=-1)
