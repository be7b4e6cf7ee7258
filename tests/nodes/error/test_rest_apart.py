"""Film at rest in pieces, of which one may be the top of a touch."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.error.rest_apart import rest_apart

WANDER = 0.001 * np.sin(np.arange(40) / 3) * np.ones((30, 1))


def distance_and_messages(step: float) -> tuple[F4, list[str]]:
    """Film at rest on both sides of a slope, the narrower side higher by a step."""
    columns = np.arange(40)
    rest = np.broadcast_to((columns < 10) | (columns > 15), (30, 40)).astype(np.uint8)
    free = WANDER + np.where(columns < 10, step, 0)
    with collect_warnings([]) as messages:
        distance = rest_apart(rest, free.astype(np.float32))
    return distance, messages


def test_a_piece_is_apart_by_the_height_of_the_slopes_between() -> None:
    distance, (line,) = distance_and_messages(0.3)
    assert distance[:, :10] == pytest.approx(0.3, abs=0.003)
    assert not distance[:, 16:].any()
    assert (np.diff(distance[:, 9:17], axis=1) < 0).all()
    assert "0.3 mm above or below another" in line


def test_pieces_no_further_apart_than_one_piece_wanders_lie_together() -> None:
    distance, messages = distance_and_messages(0.0003)
    assert not distance.any()
    assert not messages


def test_without_film_at_rest_there_is_no_distance() -> None:
    assert not rest_apart(np.zeros((30, 40), np.uint8), np.ones((30, 40), np.float32)).any()
