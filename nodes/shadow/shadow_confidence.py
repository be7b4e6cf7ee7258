"""The probability that a pixel's shadow labels are right."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.nodes import Confidence, Height, Labels, Light, LightPositions, PixelSize, Slope
from tactograph.nodes.optics.near_light import expected_light, light_vectors

MIN_EXPECTED_LIGHT = np.float32(0.02)
"""Lower bound on the expected light."""


@node(
    tolerance=Close(1e-5, why="exponentials"),
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
)
def shadow_confidence(
    shadow: Labels,
    image_labels: Labels,
    light: Light,
    sigma: Light,
    slope: Slope,
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    *,
    base_odds: Annotated[float, Gt(0)] = 7.2,
    light_odds: Annotated[float, Ge(0)] = 5.3,
    edge_odds: Annotated[float, Ge(0)] = 5.5,
    near_edge_odds: Annotated[float, Ge(0)] = 4.2,
    contradicted_odds: Annotated[float, Ge(0)] = 1.0,
    half_weight_sigmas: Annotated[float, Gt(0)] = 4.0,
) -> Confidence:
    """Return the probability that the labels of all LEDs are right.

    The log odds that an LED's label is right are a sum.  Far from the edges of its shadows they
    are `base_odds`; near an edge, which may be off by a pixel, they are lower.  The share of the
    expected light that is present, counted from -1/2 to 1/2 in favour of the label, raises or
    lowers them.  It counts less where the light is noisy, and where the image alone gives another
    label.  The probabilities of the LEDs are multiplied.

    The coefficients are log odds from a logistic regression on simulated captures
    (`benchmarks/label_confidence.py`).

    Parameters
    ----------
    shadow : H x W, the labels in question
    image_labels : H x W, the labels from the image alone, or `shadow` again
    light, sigma : K x H x W, 1 on the film at rest, and its standard deviation
    slope, height : 2 x H x W, and H x W in mm; they determine the expected light
    lights : K x 3 in mm
    pixel : mm per px
    base_odds : log odds of a label far from edges, if half of the expected light is present
    light_odds : log odds per share of the light in the label's favour
    edge_odds, near_edge_odds
        Log odds lost at one and at two pixels from another label of the same LED.
    contradicted_odds
        Replaces `light_odds` where `image_labels` differs, since that label has used the light.
    half_weight_sigmas : expected light, in standard deviations, at which its share counts half

    Returns
    -------
    H x W, 0 to 1.
    """
    vectors = light_vectors(lights, height, pixel)
    expected = np.maximum(expected_light(vectors, slope), MIN_EXPECTED_LIGHT)
    share = np.clip(light / expected, 0, 1) - 0.5
    square, doubt = expected * expected, np.float32(half_weight_sigmas) * sigma
    share *= square / (square + doubt * doubt)
    edge, near = _edges(shadow, 1), _edges(shadow, 2)
    differs = shadow ^ image_labels
    sure_of_all = np.ones(shadow.shape, np.float32)
    for k, towards_lit in enumerate(share):
        favour = np.where(shadow >> k & 1, -towards_lit, towards_lit)
        other = differs >> k & 1 > 0
        odds = np.float32(base_odds) + favour * np.where(
            other, np.float32(contradicted_odds), np.float32(light_odds)
        )
        lost = np.where(near >> k & 1, np.float32(near_edge_odds), np.float32(0))
        odds -= np.where(edge >> k & 1, np.float32(edge_odds), lost)
        sure_of_all *= 1 / (1 + np.exp(-odds))
    return np.asarray(sure_of_all, np.float32)


shadow_confidence.opencl(grid="H W", lanes="rows")


def _edges(labels: Labels, reach: int) -> NDArray[np.uint8]:
    """The LEDs whose label varies among the pixels within `reach` along each axis."""
    rows, columns = labels.shape
    padded = np.pad(labels, reach, mode="edge")
    some, every = labels.copy(), labels.copy()
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            neighbour = padded[down : down + rows, right : right + columns]
            some |= neighbour
            every &= neighbour
    return np.asarray(some & ~every, np.uint8)


@shadow_confidence.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs above the film, and shadows in blocks, so that some pixels are far from edges."""
    lights = np.column_stack([rng.uniform(-40, 40, (K, 2)), rng.uniform(20, 60, K)])
    blocks = rng.integers(0, 1 << K, (-(-H // 8), -(-W // 8)))
    shadow = np.kron(blocks, np.ones((8, 8), int))[:H, :W]
    flips = np.where(rng.random((H, W)) < 0.1, rng.integers(0, 1 << K, (H, W)), 0)
    slope, sigma = rng.uniform(-1, 1, (2, H, W)), rng.uniform(0.002, 0.05, (K, H, W))
    labels = {"shadow": shadow, "image_labels": shadow ^ flips}
    return {**labels, "sigma": sigma, "slope": slope, "lights": lights}
