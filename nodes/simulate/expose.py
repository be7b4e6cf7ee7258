"""Simulate the camera: lens, ambient light, noise, quantisation."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Interval

from tactograph.graph import node
from tactograph.nodes import Dark, Light


class Exposed(NamedTuple):
    """The camera's images, 0 to 1 of full scale."""

    image: Light
    dark: Dark


@node
def expose(
    light: Light,
    *,
    vignetting: Annotated[float, Interval(ge=0, le=1)] = 0.0,
    ambient: Annotated[float, Ge(0)] = 0.0,
    full_well: Annotated[float, Gt(0)] = 15000.0,
    shot_noise: bool = True,
    read_noise: Annotated[float, Ge(0)] = 10.0,
    bits: Annotated[int, Interval(ge=1, le=16)] = 8,
    seed: Annotated[int, Ge(0)] = 0,
) -> Exposed:
    """Return the images of the light by a camera with an ideal linear sensor.

    The mean number of electrons is the light times `full_well`.  Shot noise makes it Poisson
    distributed, and the electronics add Gaussian noise.  The result is clipped to full scale
    and rounded to `bits`.  NumPy only, because the same seed must give the same noise on every
    machine, which device generators do not promise; the noise is drawn once per capture.

    Parameters
    ----------
    light : K x H x W, 1 is full scale
    vignetting
        Share of the light that the lens loses in the image's corners; it grows with the square
        of the distance from the centre.
    ambient : light with all LEDs off, before the lens, as a share of full scale
    full_well : electrons at full scale; fewer give more noise
    shot_noise : whether to add shot noise
    read_noise : standard deviation of the electronics' noise, in electrons
    bits : bit depth; 0 to 2^bits - 1 become 0 to 1
    seed : the same seed gives the same noise
    """
    y, x = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in light.shape[1:])
    lens = np.asarray(1 - vignetting * (y[:, None] ** 2 + x[None, :] ** 2) / 2, np.float32)
    frames = np.concatenate([light, np.zeros_like(light[:1])]) + np.float32(ambient)
    electrons = (frames * lens).astype(np.float64) * full_well
    rng = np.random.Generator(np.random.Philox(seed))
    if shot_noise:
        electrons = rng.poisson(electrons).astype(np.float64)
    if read_noise > 0:
        electrons += rng.normal(0.0, read_noise, electrons.shape)
    steps = 2**bits - 1
    levels = np.rint(np.clip(electrons / full_well, 0.0, 1.0) * steps)
    image = np.asarray(levels / steps, np.float32)
    return Exposed(image[:-1], image[-1])
