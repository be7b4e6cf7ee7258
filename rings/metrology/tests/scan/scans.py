"""Scans and light models as GelSight's software writes them, made up for tests."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.nodes import F4, F8, Light
from tactograph.rings.metrology.nodes.scan.light_model import (
    LightModel,
    coefficients,
    modelled_light,
    monomials,
)
from tactograph.rings.metrology.nodes.scan.read_light_model import read_light_model

LEDS, WIDTH, HEIGHT, PIXEL = 6, 96, 64, 0.02
GAIN = 1.25
"""What the flat field of `write_model` multiplies every light with."""


def write_model(file: Path, flat: bool = True) -> LightModel:
    """A light model of six LEDs at 40 degrees, slips of its writer included; and as it is read.

    Its matrices have the rows u, v, 1.
    """
    azimuth = np.radians(60 * np.arange(LEDS) + 10)
    linear = np.zeros((3, LEDS, 3))
    linear[2] = np.stack([0.32 * np.cos(azimuth), 0.32 * np.sin(azimuth), 0.385 + 0 * azimuth], 1)
    linear[0, :, 2], linear[1, :, 0] = 0.05 * np.cos(azimuth), 0.03
    quadratic = np.zeros((3, LEDS, 10))
    quadratic[:, :, 6:9] = 0.8 * linear
    quadratic[2, :, 5], quadratic[2, :, 0], quadratic[2, :, 9] = 0.05, -0.04, 0.06
    lines = ["version: 3.0", "parameters: ", "    fov:      : 5", f"nL: {LEDS}"]
    lines += [f"width: {WIDTH}", f"height: {HEIGHT}", f"mmperpixel: {PIXEL}"]
    lines += [f"black: {[0.06] * LEDS}"]
    for name, matrix in (("linfit", linear), ("quadfit", quadratic)):
        rows = matrix.reshape(3, -1)
        lines += [f"{name}: ", "    rows: 3", f"    cols: {rows.shape[1]}"]
        lines += [f"    values: {rows.ravel().tolist()}"]
    if flat:
        sheet = np.full((2 * HEIGHT // 4, 3 * WIDTH // 4), round(0.4 / GAIN * 65535), np.uint16)
        cv2.imwrite(str(file.with_suffix(".png")), sheet)
        lines += ["flatfield: ", f'    modelfile: "{file.stem}.png"', f"    scale: {[0.4] * LEDS}"]
        lines += [f"    modelsize: ({WIDTH // 4}, {HEIGHT // 4})", f"    size: ({WIDTH}, {HEIGHT})"]
    file.write_text("\n".join(lines) + "\n")
    return read_light_model(file=file).model


def write_scan(folder: Path, light: Light, calib: str = '""', pixel: float = PIXEL) -> None:
    """A scan whose images are numbered from 7 on and listed last to first."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [f"image{7 + k:02}.png" for k in range(len(light))][::-1]
    for name, plane in zip(names, light, strict=True):
        cv2.imwrite(str(folder / name), np.uint16(65535 * plane))
    lines = ["images: ", *(f"  - {name}" for name in names), f"mmperpixel: {pixel}"]
    lines += [f"calib: {calib}", "crop: [0, 0, 0, 0]", "annotations: ", "  - type: GridCircle"]
    lines += ["    gx: 1", "    gy: -2", "    x: 30.5", "    y: 20", "    r: 9"]
    (folder / "scan.yaml").write_text("\n".join(lines) + "\n")


def seen(height: F4, model: LightModel, pixel: float = PIXEL) -> Light:
    """The images of a height by the model, the flat field not yet corrected."""
    return lit(*np.gradient(height.astype(float) / pixel)[::-1], model)


def lit(p: F8, q: F8, model: LightModel) -> Light:
    """The images of film of these slopes, H x W."""
    w = 1 / np.sqrt(1 + p * p + q * q)
    powers = monomials(*np.meshgrid(model.u, model.v), int(model.degree))
    light, _ = modelled_light(coefficients(model.quadratic, powers), np.stack([-p * w, -q * w, w]))
    return np.float32(light if model.gain is None else light / model.gain)


def cap(radius: float = 0.6, depth: float = 0.2) -> F4:
    """A cap of a ball in the middle of the frame, mm."""
    y, x = PIXEL * (np.mgrid[:HEIGHT, :WIDTH] - np.array([HEIGHT / 2, WIDTH / 2])[:, None, None])
    z = np.sqrt(np.maximum(radius**2 - x * x - y * y, 0)) - (radius - depth)
    return np.maximum(z, 0).astype(np.float32)


def groove_shape(
    depth: float,
    wall_deg: float,
    width: float,
    shape: tuple[int, int] = (HEIGHT, WIDTH),
    pixel: float = PIXEL,
) -> F4:
    """A groove down the middle, its width at half depth; mm."""
    x = np.abs(pixel * (np.arange(shape[1]) - shape[1] / 2))
    wall = depth / np.tan(np.radians(wall_deg))
    profile = -depth * np.clip(((width + wall) / 2 - x) / wall, 0, 1)
    return np.tile(profile.astype(np.float32), (shape[0], 1))
