"""The zero of a height is known where film at the border is at rest, and as uncertain as it is."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4, U1
from tactograph.nodes.error.zero_error import zero_error
from tactograph.nodes.trust.touch_evidence import touch_evidence

SHAPE = (60, 80)
ERROR = np.full(SHAPE, np.float32(0.0005))
NONE = np.zeros(SHAPE, np.uint8)
CALM = np.ones((4, *SHAPE), np.float32)
Y, X = np.mgrid[-30:30, -40:40] / 10


def off(height: F4, rest: U1 = NONE, light: F4 = CALM, drift: F4 | None = None) -> float:
    return zero_error(
        height, ERROR, rest, touch_evidence(ERROR, light, height, drift), np.float32(0.1)
    )


def bulged(depth: float, lifted: float) -> F4:
    """A pressed ball whose film has not come to rest where the frame ends, from its border."""
    away = np.hypot(X, Y)
    height = depth * np.exp(-away) + lifted * np.sin(3 * np.arctan2(Y, X))
    return np.asarray(height - np.median(height[0]), np.float32)


def test_film_held_at_zero_makes_it_known_beside_any_touch() -> None:
    height = np.zeros(SHAPE, np.float32)
    height[:, 55:] = 0.6
    rest = (height == 0).astype(np.uint8)
    assert off(height, rest) == 0


def test_a_wall_that_crosses_the_border_says_nothing_of_the_zero() -> None:
    """Film hangs from a groove's edge, and is not held within a margin of that."""
    height = np.tile(0.3 * np.exp(-np.abs(np.arange(80) - 40) / 4), (60, 1)).astype(np.float32)
    rest = (height < 0.001).astype(np.uint8)
    assert off(height, rest) < 1e-3


def test_a_flat_top_around_most_of_the_border_does_not_count() -> None:
    """As for `rest_mask`, film nearer to the top than to zero is a touch."""
    height = np.full(SHAPE, np.float32(0.6))
    height[:, :10] = 0
    assert off(height, (height == 0).astype(np.uint8)) == 0


@settings(max_examples=20)
@given(st.floats(0.005, 0.05))
def test_zero_is_as_uncertain_as_film_at_the_border_is_uneven(lifted: float) -> None:
    with collect_warnings([]) as messages:
        found = off(bulged(0.0, lifted))
    assert found == pytest.approx(0.9 * lifted, rel=0.15)
    (line,) = messages
    assert f"deviation of {1e3 * found:.2g} um" in line


def test_zero_is_the_better_known_the_more_film_is_held() -> None:
    """Held film takes 2 or 4 mm of the border on either side."""
    height = bulged(0.0, 0.01)
    rest = (np.abs(Y) < 1.0).astype(np.uint8) * (np.abs(X) > 3)
    more = (np.abs(Y) < 2.0).astype(np.uint8) * (np.abs(X) > 3)
    found = [off(height, each.astype(np.uint8)) for each in (NONE, rest, more)]
    places = [4 / 1.2, 8 / 1.2]
    assert found[1:] == pytest.approx([found[0] / np.sqrt(n) for n in places], rel=0.25)


def test_a_touch_over_the_whole_frame_is_as_uncertain_as_it_is_high() -> None:
    """Film at rest at the borders makes zero known, also under LEDs that all faded."""
    height = np.asarray(0.4 * np.sin(5 * X) * np.sin(5 * Y), np.float32)
    waves = 1 + 0.3 * np.sin(np.arange(80, dtype=np.float32))
    with collect_warnings([]) as messages:
        found = off(height, light=np.broadcast_to(waves, CALM.shape).astype(np.float32))
    assert found == pytest.approx(np.ptp(height))
    assert len(messages) == 1
    faded = np.zeros((4, 6), np.float32)
    faded[:, 0] = 0.8
    held = np.where(np.hypot(X, Y) < 2, height, np.float32(0))
    assert off(held, (held == 0).astype(np.uint8), 0.8 * CALM, faded) == 0


def test_film_that_noise_alone_keeps_from_being_held_gives_no_warning() -> None:
    noise = np.random.default_rng(1).normal(0, 4e-4, SHAPE).astype(np.float32)
    with collect_warnings([]) as messages:
        assert off(noise) == pytest.approx(4e-4, rel=0.2)
    assert not messages
