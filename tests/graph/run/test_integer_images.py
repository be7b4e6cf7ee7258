"""A source may leave images as the camera's integers if only the device reads them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.cache.cache import Cache
from tactograph.graph.compare.stored_views import views_of
from tactograph.graph.run.host_values import HostValues
from tests.graph.conftest import graph_of
from tests.graph.toys import WHOLE

pytestmark = pytest.mark.usefixtures("toys")

GRAPH = """
format: 1
title: A camera's integers
params: {}
prefer: [opencl, numpy]
nodes:
  frames: {op: whole_touches}
  flat:   {op: at_rest, with: {rows: 4, columns: 5}}
  light:  {op: flat_field, in: {image: frames.image, flat: flat.flat, dark: flat.dark}}
outputs: {light: light}
"""
READ_BY_THE_HOST = GRAPH.replace(
    "nodes:\n", "nodes:\n  more: {op: doubled, in: {image: frames.image}}\n"
).replace("{light: light}", "{light: light, more: more}")
AN_OUTPUT = GRAPH.replace("{light: light}", "{light: light, image: frames.image}")


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The types of the stacks of images that go up to a device."""
    types: list[str] = []

    def watching(start: Callable[..., Any]) -> Callable[..., Any]:
        def watched(self: OpenCL, array: Any) -> Any:
            if array.shape == WHOLE.shape and array.max() > 0 and array.min() < 0.5:
                types.append(str(array.dtype))
            return start(self, array)

        return watched

    monkeypatch.setattr(OpenCL, "start_upload", watching(OpenCL.start_upload))
    return types


@pytest.mark.parametrize("graph", [GRAPH, READ_BY_THE_HOST, AN_OUTPUT])
def test_integers_count_as_fractions_of_full_scale(graph: str, backend: str) -> None:
    (result,) = load(graph_of(graph), backend=backend).items()
    expected = WHOLE / np.float32(255)
    np.testing.assert_allclose(result["light"], expected, atol=1e-6)
    for name, times in (("more", 2), ("image", 1)):
        if name in result.outputs:
            assert result[name].dtype == np.float32
            np.testing.assert_array_equal(result[name], times * expected)


@pytest.mark.parametrize(
    ("graph", "kind"), [(GRAPH, "uint8"), (READ_BY_THE_HOST, "float32"), (AN_OUTPUT, "float32")]
)
def test_a_source_yields_integers_only_if_the_device_alone_reads_them(
    sent: list[str], graph: str, kind: str
) -> None:
    list(load(graph_of(graph), backend="opencl").items())
    assert sent == [kind]


def test_a_source_that_is_not_asked_for_integers_may_still_yield_them(
    monkeypatch: pytest.MonkeyPatch, backend: str
) -> None:
    monkeypatch.setattr(HostValues, "integer_keyword", lambda *_: {"integers": True})
    (result,) = load(graph_of(READ_BY_THE_HOST), backend=backend).items()
    np.testing.assert_array_equal(result["more"], 2 * (WHOLE / np.float32(255)))


def test_inspected_and_drawn_images_are_fractions() -> None:
    pipeline = load(graph_of(GRAPH), backend="opencl", cache=Cache())
    result = next(iter(pipeline.items()))
    (drawn,) = [view.array for view in views_of(result) if view.name == "image"]
    for image in (drawn, pipeline.inspect("frames.image")):
        np.testing.assert_array_equal(image, WHOLE / np.float32(255))
