"""Find where the film mirrors an LED, and exclude that light."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt, Interval

from tactograph.graph import Flips, SizeLimit, node
from tactograph.nodes import Height, Labels, Light, LightPositions, PixelSize
from tactograph.nodes.light._cache_blocks import in_blocks
from tactograph.nodes.light._near_light import expected_light, light_vectors
from tactograph.nodes.shadow._pieces import images_of, room_for

FEWEST = 3
"""LEDs that must remain: two would allow two normals."""
UNKNOWN = np.float32(1e3)
"""Standard deviation of a light that carries no information."""


class Highlights(NamedTuple):
    """The mirrored LEDs, and standard deviations by which their light no longer counts."""

    highlight: Labels
    sigma: Light


class Limits(NamedTuple):
    """The node's parameters; `near` is the cosine of the lobe's angle."""

    unlikely: np.float32
    likely: np.float32
    excess: np.float32
    near: np.float32


@node(
    sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")},
    tolerance=Flips(2e-3, why="thresholds on chi-squares, of sums in float32"),
)
def label_highlights(
    light: Light,
    sigma: Light,
    lights: LightPositions,
    height: Height,
    pixel: PixelSize,
    *,
    unlikely: Annotated[float, Gt(0)] = 25.0,
    likely: Annotated[float, Gt(0)] = 12.0,
    excess: Annotated[float, Gt(0)] = 4.0,
    lobe_deg: Annotated[float, Interval(gt=0, le=90)] = 20.0,
) -> Highlights:
    """Mark the LED whose light exceeds what the others predict, where it could be mirrored.

    The idea is Barsky and Petrou's ("The 4-source photometric stereo technique for
    three-dimensional surfaces in the presence of highlights and shadows", 2003): with four
    LEDs any three predict the fourth.  Where no unit normal fits all of them (`_near_light`,
    N1), each LED is left out in turn.  The one without which the others fit best is a
    highlight if the others fit well, it is brighter than they predict, and their normal lies
    near the direction half-way between LED and camera.  A darker LED is in shadow;
    `label_lights` finds it.  With three LEDs nothing is marked.

    Parameters
    ----------
    light, sigma
        K x H x W, relative to the film at rest, and its standard deviation.
    lights
        K x 3 in mm from the middle of the image.
    height
        H x W in mm, as far as known.
    pixel
        mm per px.
    unlikely
        Chi-square of all LEDs together above which one of them is doubted.
    likely
        Chi-square of the others below which they agree.
    excess
        Standard deviations by which a highlight is at least brighter than predicted.
    lobe_deg
        Largest angle between the normal and the half-way direction.

    Returns
    -------
    Highlights
        H x W, bit k-1 set where LED k is mirrored; K x H x W, `sigma`, raised to 1000 there,
        so that `label_lights` ignores that light without calling it a shadow.
    """
    from tactograph.nodes.shadow._highlight_loops import mark

    count = len(light)
    highlight = np.zeros(height.shape, np.uint8)
    images = images_of(light, sigma, lights, height, pixel)
    near = np.cos(np.deg2rad(np.float32(lobe_deg)))
    limits = Limits(*map(np.float32, (unlikely, likely, excess, near)))

    def mark_rows(rows: slice) -> None:
        mark(rows.start, rows.stop, images, limits, room_for(count), highlight)

    if count > FEWEST:
        in_blocks(mark_rows, *height.shape)
    raised = sigma.copy()
    for k, plane in enumerate(raised):
        plane[(highlight >> k & 1) > 0] = UNKNOWN
    return Highlights(highlight, raised)


label_highlights.opencl(grid="H W", lanes="grid")


@label_highlights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Random slopes under LEDs around the film, with highlights and shadows here and there."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    places_mm = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    lights = np.asarray(places_mm, np.float32)
    height = rng.uniform(0, 1, (H, W)).astype(np.float32)
    slope = rng.uniform(-1, 1, (2, H, W)).astype(np.float32)
    light = expected_light(light_vectors(lights, height, 0.1), slope)
    light += rng.normal(0, 0.01, light.shape) + (rng.random(light.shape) < 0.1)
    light *= rng.random(light.shape) < 0.9
    return {
        "light": light.astype(np.float32),
        "sigma": np.full_like(light, 0.01),
        "lights": lights,
        "height": height,
        "pixel": 0.1,
    }
