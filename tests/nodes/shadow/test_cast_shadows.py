"""The shadow of a ball is that of the rays from every place to the LED."""

import numpy as np
import pytest

from tactograph.nodes.shadow.cast_shadows import cast_shadows

PIXEL, RADIUS, SHAPE = 0.05, 1.5, (161, 201)


@pytest.mark.parametrize("attached", [False, True])
@pytest.mark.parametrize(
    "led",
    [
        (30, 2, 20),
        (-3, -40, 15),
        (-4, -4, 5),
        (3, 0, 4),
        (-1e5, 1e5, 1e5),
        (0, 0, 30),
        (30, 2, -20),
        (-3, -40, -15),
        (-9, -8, -6),
    ],
    ids=[
        "far",
        "across",
        "corner",
        "within",
        "parallel",
        "above",
        "opposite",
        "opposite, across",
        "opposite, corner",
    ],
)
def test_half_a_ball_on_the_film_casts_its_exact_shadow(
    led: tuple[float, float, float], attached: bool
) -> None:
    """The terminator is found to a tenth of a pixel where the pixel's own slope counts.

    The light of an LED below the film arrives from the opposite direction.
    """
    y, x = ((np.arange(n) - (n - 1) / 2) * PIXEL for n in SHAPE)
    place = np.stack(np.broadcast_arrays(x, y[:, None], 0.0))
    plan = np.hypot(*place[:2])
    place[2] = np.sqrt(np.maximum(RADIUS**2 - plan**2, 0))
    height = place[2].astype(np.float32)
    dark = cast_shadows(height, np.float32([led]), PIXEL, attached=attached) == 1
    ray = (np.reshape(led, (3, 1, 1)) - place) * np.sign(led[2])
    ray /= np.linalg.norm(ray, axis=0)
    along = (place * ray).sum(0)
    passes = np.sqrt((place**2).sum(0) - along**2)
    outside = plan > RADIUS + 2 * PIXEL
    expected = np.where(outside, (along < 0) & (passes < RADIUS), along < 0)
    clear = (
        np.where(outside, abs(passes - RADIUS), abs(along) * (10 if attached else 1 / 3)) > PIXEL
    )
    clear &= outside | (plan < 0.9 * RADIUS)
    assert clear.mean() > 0.7
    np.testing.assert_array_equal(dark[clear], expected[clear])
