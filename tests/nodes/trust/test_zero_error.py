"""Where nothing is at rest, the height's zero is uncertain."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.touch_evidence import touch_evidence
from tactograph.nodes.trust.zero_error import zero_error

SHAPE = (30, 40)
HEIGHT = np.linspace(-0.2, 0.6, 30 * 40, dtype=np.float32).reshape(SHAPE)


def error(light: F4, drift: F4 | None = None) -> float:
    return zero_error(touch_evidence(HEIGHT, light, HEIGHT, drift))


def test_a_touch_over_the_whole_frame_is_as_uncertain_as_it_is_high() -> None:
    """Film at rest at the borders makes zero known, also under LEDs that all faded."""
    waves = 1 + 0.3 * np.sin(np.arange(40, dtype=np.float32))
    assert error(np.broadcast_to(waves, (4, *SHAPE)).astype(np.float32)) == pytest.approx(0.8)
    light = np.ones((4, *SHAPE), np.float32)
    light[0, 8:22, 10:30] = 1.4
    assert error(light) == 0
    faded = np.zeros((4, 6), np.float32)
    faded[:, 0] = 0.8
    assert error(np.full((4, *SHAPE), 0.8, np.float32), faded) == 0
