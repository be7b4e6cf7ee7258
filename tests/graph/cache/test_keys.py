"""Keys are equal for equal content, and for nothing else."""

from typing import Any

import numpy as np
import pytest

from tactograph.graph.cache.keys import content_key

VALUES: list[Any] = [
    None, 0, 0.0, False, "", b"", (), [], {}, "0", (0,), ((0,), 1), (0, (1,)), {"a": 1},
    np.zeros(2, np.float32), np.zeros(2, np.int32), np.zeros((2, 1), np.float32),
    np.ones(2, np.float32), np.zeros((2, 0), np.float32), np.float32(0),
]  # fmt: skip


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_equal_values_have_equal_keys(value: Any) -> None:
    copy = value.copy() if isinstance(value, np.ndarray | dict | list) else value
    assert content_key(value) == content_key(copy)


def test_different_values_have_different_keys() -> None:
    assert len({content_key(value) for value in VALUES}) == len(VALUES)


def test_a_view_has_the_key_of_its_content() -> None:
    array = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert content_key(array.T) == content_key(np.ascontiguousarray(array.T))
    assert content_key(array.T) != content_key(array)


def test_an_unknown_object_equals_nothing() -> None:
    thing = object()
    assert content_key(thing) != content_key(thing)
