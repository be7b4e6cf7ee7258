"""Warnings of nodes are Python warnings too, once per pipeline."""

import warnings
from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np
import pytest

from tactograph.graph import InputError, load, node, warn
from tactograph.graph.run.pipeline import Pipeline
from tactograph.nodes import Light

IMAGE = np.full((3, 8, 8), 0.5, np.float32)


def telling(texts: list[str]) -> Pipeline:
    """A pipeline whose node warns of one text after another; of "refuse", it refuses the next."""
    next_text: Iterator[str] = cycle(texts)

    @node
    def doubtful(light: Light) -> Light:
        """Warn of the next text."""
        text = next(next_text)
        if text:
            warn(text.removeprefix("refuse: "))
        if text.startswith("refuse"):
            raise InputError("refused")
        return light

    graph: dict[str, Any] = {
        "format": 1,
        "params": {"capture": {"kind": "path"}},
        "nodes": {
            "frames": {"op": "read_capture", "with": {"folder": "$capture"}},
            "doubt": {"op": "doubtful", "in": {"light": "frames.image"}},
        },
        "outputs": {"light": "doubt"},
    }
    return load(graph, backend="numpy", nodes=[doubtful])


def raised(pipeline: Pipeline, calls: int) -> list[str]:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for _ in range(calls):
            pipeline(frames=IMAGE)
    assert all(line.category is UserWarning for line in told)
    assert {line.filename for line in told} <= {__file__}, "they point at the caller's line"
    return [str(line.message) for line in told]


def test_a_nodes_warning_is_raised_once_and_stays_in_every_result() -> None:
    pipeline = telling(["the light fits no surface"])
    assert raised(pipeline, 3) == ["the light fits no surface"]
    assert pipeline(frames=IMAGE).warnings == ["the light fits no surface"]


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (["", "too dark", "", "too bright"], ["too dark", "too bright"]),
        (
            ["LED 1 is 12.5 % darker", "LED 1 is 13 % darker", "LED 2 is 13 % darker"],
            ["LED 1 is 12.5 % darker", "LED 2 is 13 % darker"],
        ),
    ],
    ids=["another warning", "another LED, but no changed figure"],
)
def test_a_new_warning_is_raised_when_it_occurs(texts: list[str], told: list[str]) -> None:
    for _ in range(2):  # every pipeline raises its own
        assert raised(telling(texts), 2 * len(texts)) == told


def test_a_warning_before_a_refusal_is_raised_too() -> None:
    with (
        pytest.warns(UserWarning, match="look at this first"),
        pytest.raises(InputError, match="refused"),
    ):
        telling(["refuse: look at this first"])(frames=IMAGE)


def test_as_errors_they_stop_the_script() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="too dark"):
            telling(["too dark"])(frames=IMAGE)
