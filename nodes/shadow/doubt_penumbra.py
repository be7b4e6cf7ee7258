"""Raise the standard deviation of light that a penumbra may dim."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import (
    BAND_DEVIATIONS,
    F4,
    Blur,
    Diffuse,
    Height,
    Light,
    LightPositions,
    PixelSize,
    Refraction,
    Slope,
)
from tactograph.nodes.optics.bilinear import mask_at
from tactograph.nodes.optics.film import MIN_MATT_LIGHT
from tactograph.nodes.optics.near_light import lights_around, matt_film_light
from tactograph.nodes.optics.rays import rays_towards
from tactograph.nodes.slope.pixel_mean_slope import PIXEL_VARIANCE
from tactograph.nodes.slope.sharpen_slope import has_no_matt_blur

EDGE_DEVIATIONS = 4
"""Width of a blurred edge, from 2 to 98 % of its light, in standard deviations of the blur."""
BLOCK_PX = 16
"""Side of a block that is searched for dark film."""


@node(
    neutral="sigma",
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
    tolerance=Close(1e-5, 1e-5, share=2e-3, why="a rounded direction chooses another pixel"),
)
def doubt_penumbra(
    sigma: Light,
    light: Light,
    lights: LightPositions,
    height: Height,
    slope: Slope,
    leds: LightPositions,
    pixel: PixelSize,
    blur: Blur,
    refraction: Refraction,
    diffuse: Diffuse,
) -> Light:
    """Return the deviation of the light, with what is missing of the light expected near shadows.

    The camera blurs the end of a shadow, where a part of the light arrives.  Shadows of two LEDs
    that end together then look like film that faces away from both.  So where film is dark within
    the width of a blurred edge towards an LED, what is missing of that LED's expected light is
    added to its deviation (P1).  Under a coat nothing changes (see `penumbras` of `matt_light`),
    nor in a gel that diffuses light, since all its shadows end softly.

    Parameters
    ----------
    sigma, light : K x H x W, the standard deviation of the light, and the light; 1 at rest
    lights : K x 3 in mm from the middle of the image
    height, slope : H x W in mm, and 2 x H x W, as expected
    leds : K x 3 in mm, `lights` in the camera's view (`lights_in_view`)
    pixel : mm per px
    blur : of the camera, in px; 0 returns sigma
    refraction : of the film's coat; 1 without a coat
    diffuse : length K, the share of each LED's light that the gel diffuses
    """
    if has_no_matt_blur(blur, refraction, diffuse):
        return sigma
    expected = matt_film_light(lights, height, slope, pixel)
    missing = np.maximum(expected - light - np.float32(BAND_DEVIATIONS) * sigma, 0)
    reach = int(np.ceil(EDGE_DEVIATIONS * np.sqrt(np.float32(blur * blur + PIXEL_VARIANCE))))
    for plane, shown, led in zip(missing, light, leds / np.float32(pixel), strict=True):
        plane *= _before_dark(shown < MIN_MATT_LIGHT, led, reach)
    return np.asarray(np.hypot(sigma, missing), np.float32)


def _before_dark(dark: NDArray[np.bool_], led: F4, reach: int) -> NDArray[np.bool_]:
    """Whether a pixel up to `reach` px away, towards the LED (in px), is dark."""
    row, column = np.mgrid[tuple(map(slice, dark.shape))].astype(np.float32)
    rays = rays_towards(led, column, row, dark.shape)
    steps = [mask_at(dark, *rays.at(np.float32(t))) for t in range(1, reach + 1)]
    return np.logical_or.reduce(steps)


doubt_penumbra.idle(has_no_matt_blur)


@doubt_penumbra.opencl()
def _launch(run: Launch) -> None:
    """Mark blocks with dark film first, since most film is far from any."""
    inputs, sizes = run.inputs, tuple(run.sizes[symbol] for symbol in "KHW")
    lights, rows, columns = sizes
    blocks = -(-rows // BLOCK_PX), -(-columns // BLOCK_PX)
    dark = run.scratch((lights, *blocks), np.uint8)
    run.kernel("mark_dark", dark.shape, inputs["light"], dark, *sizes, *blocks, BLOCK_PX)
    run.kernel(
        "doubt_penumbra", run.in_row_lanes(rows, columns),
        *map(inputs.get, doubt_penumbra.inputs), dark, run.outputs["doubt_penumbra"],
        *sizes, *blocks, BLOCK_PX,
    )  # fmt: skip


@doubt_penumbra.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Dark spots on a film that mostly is matt; some LEDs lie below it (`lights_in_view`)."""
    lights = lights_around(rng, K)
    light = rng.uniform(0.2, 1, (K, H, W)) * (rng.random((K, H, W)) > 0.015)
    return {
        "light": light.astype(np.float32),
        "sigma": rng.uniform(0.005, 0.02, (K, H, W)).astype(np.float32),
        "lights": lights,
        "leds": lights * rng.choice(np.array([1, 1, -1], np.float32), (K, 1)),
        "blur": float(rng.uniform(0.2, 0.9)),
        "refraction": float(rng.choice([1.0, 1.0, 1.5])),
        "diffuse": np.float32(0.2 * (rng.random() < 0.2)) * rng.random(K, np.float32),
    }
