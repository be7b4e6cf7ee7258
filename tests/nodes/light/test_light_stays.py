"""Motion is distinguished from noise, however large the noise is."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.light.light_stays import light_stays
from tests.nodes.scenes import ball

SHAPE = 60, 80
SIGMA = np.full((3, *SHAPE), 0.01, np.float32)


def image(seed: int, moved_px: float = 0.0, noise: float = 0.002) -> F4:
    """A ball under three lights, through a lens whose correction mixes the noise of neighbours."""
    _, slope = ball(*SHAPE, 60)
    light = np.stack([1 + 0.4 * slope[0], 1 - 0.4 * slope[0], 1 + 0.4 * slope[1]])
    shift = np.float32([[1, 0, moved_px], [0, 1, 0]])
    moved = [cv2.warpAffine(plane, shift, SHAPE[::-1], borderValue=1.0) for plane in light]
    grain = np.random.default_rng(seed).normal(0, noise, light.shape)
    mixed = [cv2.blur(plane, (2, 2), borderType=cv2.BORDER_REFLECT) for plane in grain]
    return (np.stack(moved) + mixed).astype(np.float32)


@pytest.mark.parametrize("noise", [0.0, 0.0005, 0.02])
def test_noise_is_no_motion(noise: float) -> None:
    first = light_stays(image(0, noise=noise), SIGMA)
    assert first.still == 0
    then = light_stays(image(1, noise=noise), SIGMA, first.reference)
    assert then.still == 1
    assert then.reference is first.reference


def test_slow_motion_adds_up() -> None:
    """Each step is below the noise; the frame that is remembered is the last that moved."""
    memory = light_stays(image(0, noise=0.02), SIGMA).reference
    still = []
    for number in range(1, 21):
        result = light_stays(image(number, 0.05 * number, 0.02), SIGMA, memory)
        memory = result.reference
        still.append(result.still)
    assert still[0] == 1
    assert 0 in still[:10]
    assert 0 in still[10:]


def test_a_jump_is_motion_whose_light_is_remembered() -> None:
    light = image(1, moved_px=3.0)
    result = light_stays(light, SIGMA, image(0))
    assert result.still == 0
    assert np.array_equal(result.reference, light)
