"""OpenCV's functions by name: what a graph may call, and how other calls are refused."""

from typing import Any

import numpy as np
import pytest

from tactograph import load
from tactograph.graph.errors import GraphError
from tactograph.rings.filters.nodes._opencv_functions import FUNCTION_NAMES
from tactograph.rings.filters.nodes.opencv import opencv

EXAMPLES: dict[str, dict[str, Any]] = {
    "blur": {"ksize": [3, 5]},
    "GaussianBlur": {"ksize": [5, 5], "sigmaX": 1.0},
    "medianBlur": {"ksize": 3},
    "bilateralFilter": {"d": 5, "sigmaColor": 0.1, "sigmaSpace": 2},
    "filter2D": {"kernel": [[0, -1, 0], [-1, 5, -1], [0, -1, 0]]},
    "sepFilter2D": {"kernelX": [1, 2, 1], "kernelY": [1], "borderType": "BORDER_REFLECT"},
    "Sobel": {"dx": 1, "dy": 0},
    "Scharr": {"dx": 0, "dy": 1},
    "Laplacian": {"ksize": 3},
    "erode": {"kernel": [[1, 1, 1]]},
    "dilate": {"kernel": [[1, 1, 1]], "iterations": 2},
}


def graph(call: Any) -> dict[str, Any]:
    return {
        "format": 1,
        "title": "A function of OpenCV",
        "nodes": {
            "frames": {"op": "read_capture", "with": {"folder": "nowhere"}},
            "found": {"op": "opencv", "in": {"light": "frames.image"}, "with": {"call": call}},
        },
        "outputs": {"found": "found"},
    }


def test_sobel_finds_the_slope_of_a_ramp() -> None:
    ramp = np.broadcast_to(np.arange(9, dtype=np.float32), (2, 7, 9))
    call = {"Sobel": {"dx": 1, "dy": 0, "scale": 1 / 8}}
    load(graph(call))
    np.testing.assert_allclose(opencv(ramp, call=call)[:, :, 1:-1], 1)


@pytest.mark.parametrize("name", FUNCTION_NAMES)
def test_every_listed_function_gives_an_image_of_the_same_size(name: str) -> None:
    light = np.random.default_rng(1).random((3, 12, 17), np.float32)
    found = opencv(light, call={name: EXAMPLES[name]})
    assert (found.shape, found.dtype) == (light.shape, np.float32)
    assert not np.array_equal(found, light)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ({"sobel": {"dx": 1, "dy": 0}}, "'sobel' is not on the list.*did you mean 'Sobel'"),
        ({"imwrite": {"filename": "x.png"}}, "'imwrite' is not on the list"),
        (
            {"Sobel": {"dx": 1, "dy": 0, "size": 3}},
            "'size' is an invalid keyword argument for Sobel",
        ),
        ({"Sobel": {"dx": 1}}, "'Sobel' of OpenCV .*missing required argument 'dy'"),
        ({"GaussianBlur": {"ksize": [4, 4], "sigmaX": 1}}, "ksize.width % 2 == 1"),
        ({"filter2D": {"kernel": [[1, 1], [1]]}}, "'filter2D': setting an array element"),
        ({"erode": {"kernel": [[1]], "iterations": 10**9}}, "'erode': iterations: 101"),
        ({"erode": {"kernel": [[float("nan")]]}}, "kernel: a finite number"),
        ({"Sobel": {"dx": 0, "dy": 0}}, "'Sobel' of OpenCV refuses these arguments"),
        ({"blur": {"ksize": [3, 3]}, "medianBlur": {"ksize": 3}}, "name one function"),
        ({"blur": {"ksize": [3, 3], "borderType": "imread"}}, "'blur': borderType"),
    ],
)
def test_a_call_that_is_not_right_is_refused_before_anything_runs(call: Any, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        load(graph(call))
