"""Figures of several evaluations together."""

import pytest

from tactograph.graph import InputError
from tactograph.nodes.evaluate.join_metrics import join_metrics


def test_the_order_of_the_inputs_is_kept() -> None:
    assert list(join_metrics({"b": 1.0}, {"a": 2.0}, {}, {"c": 3.0})) == ["b", "a", "c"]


def test_a_figure_named_twice_is_refused() -> None:
    with pytest.raises(InputError, match="called 'a'"):
        join_metrics({"a": 1.0}, {"a": 1.0})
