"""A small simulated sensor whose gel is changed, worn and soiled."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.simulate.diffuse_gel import diffuse_gel
from tactograph.nodes.simulate.interreflect import interreflect
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.render import render

WIDTH, HEIGHT, PIXEL_MM = 96, 72, 0.21
X, Y = (
    ((c - (n - 1) / 2) * PIXEL_MM).astype(np.float32)
    for c, n in zip(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), (WIDTH, HEIGHT), strict=True)
)
FLASHED = light_ring(count=4, slant_deg=39.0, distance_mm=47.0)


def ball(x: float, y: float, radius: float, depth: float) -> F4:
    """A ball pressed to a depth in mm, at a place in mm from the middle of the film."""
    below = np.sqrt(np.maximum(radius**2 - (X - x) ** 2 - (Y - y) ** 2, 0))
    return np.maximum(below - (radius - depth), 0).astype(np.float32)


def bump(x: float, y: float, size: float, height: float = 1.0) -> F4:
    """A Gaussian of a height in mm; its size is the standard deviation."""
    away = (X - x) ** 2 + (Y - y) ** 2
    return (height * np.exp(-away / (2 * size**2))).astype(np.float32)


class Gel:
    """A film under LEDs: what the camera sees of it, bounced light and texture included."""

    def __init__(
        self,
        lights: F4 = FLASHED,
        seed: int = 1,
        *,
        thicker: float = 0.0,
        albedo: float = 0.7,
        alpha: float = 0.2,
        dent: float = 0.0,
    ) -> None:
        self.lights = lights + np.array([0, 0, thicker], np.float32)
        self.albedo, self.alpha = albedo, alpha
        self.dent = bump(3, -2, 1.0, dent)
        self.rng = np.random.default_rng(seed)
        texture = cv2.GaussianBlur(self.rng.normal(size=X.shape).astype(np.float32), (0, 0), 1.5)
        self.texture = 1 + 0.01 * texture / texture.std()
        self.rest = self._lit(np.zeros_like(X))

    def _lit(self, height: F4) -> F4:
        return render(
            height, PIXEL_MM, self.lights, cosine_leds=True, coat_alpha=self.alpha,
            albedo=self.albedo, refractive_index=1.4,
        ).light  # fmt: skip

    def height(self, thing: F4 | None = None) -> F4:
        """The film's height with something pressed into it, or without."""
        return self.dent if thing is None else np.maximum(press(thing, PIXEL_MM), self.dent)

    def seen(self, thing: F4 | None = None) -> F4:
        """The image of the camera, K x H x W."""
        height = self.height(thing)
        light = diffuse_gel(self._lit(height), self.rest, share=0.2)
        if height.any():
            light = interreflect(
                light, self.rest, height, self.lights, PIXEL_MM, albedo=0.9 * self.albedo
            )
        light = 0.8 * light * self.texture * self.albedo / 0.7
        noise = 0.002 * np.sqrt(light) * self.rng.normal(size=light.shape)
        return np.clip(light + noise, 0, 1).astype(np.float32)


def save(folder: Path, light: F4, colour: bool = False) -> Path:
    """Write a capture of 16 bit: an image for each LED, or one in three colours."""
    folder.mkdir(parents=True, exist_ok=True)
    counts = np.round(light * 65535).astype(np.uint16)
    if colour:
        cv2.imwrite(str(folder / "image.png"), np.moveaxis(counts, 0, -1))
    else:
        for k, plane in enumerate(counts, start=1):
            cv2.imwrite(str(folder / f"led{k}.png"), plane)
    return folder
