"""A window of images."""

import numpy as np
import pytest

from tactograph.graph import InputError, load
from tactograph.graph.declare.check_settings import model_of
from tactograph.rings.filters.nodes.crop import crop

LIGHT = np.arange(3 * 12 * 16, dtype=np.float32).reshape(3, 12, 16)


def graph(window: object) -> dict[str, object]:
    return {
        "format": 1,
        "params": {"capture": {"kind": "path"}},
        "nodes": {
            "frames": {"op": "read_capture", "with": {"folder": "$capture"}},
            "part": {"op": "crop", "in": {"light": "frames.image"}, "with": {"window": window}},
            "smooth": {"op": "median_blur", "in": {"light": "part"}},
        },
        "outputs": {"part": "part", "smooth": "smooth"},
    }


def test_a_window_is_its_pixels() -> None:
    found = crop(LIGHT, window=(4, 2, 5, 3))
    np.testing.assert_array_equal(found, LIGHT[:, 2:5, 4:9])
    np.testing.assert_array_equal(crop(LIGHT), LIGHT)
    np.testing.assert_array_equal(crop(LIGHT, window=(15, 11, 1, 1)), LIGHT[:, 11:, 15:])


@pytest.mark.parametrize("backend", ["numpy", "opencl"])
def test_what_follows_has_the_size_of_the_window(backend: str) -> None:
    found = load(graph([4, 2, 5, 3]), backend=backend)(frames=LIGHT / 1000)
    np.testing.assert_array_equal(found["part"], LIGHT[:, 2:5, 4:9] / 1000)
    assert found["smooth"].shape == (3, 3, 5)


@pytest.mark.parametrize("backend", ["numpy", "opencl"])
@pytest.mark.parametrize(
    ("window", "message"),
    [
        ([4, 2, 13, 3], "a window of 13 columns from 4 on ends beyond the image's 16"),
        ([4, 2, 5, 11], "a window of 11 rows from 2 on ends beyond the image's 12"),
    ],
)
def test_a_window_that_ends_beyond_the_frame_is_refused(
    backend: str, window: list[int], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load(graph(window), backend=backend)(frames=LIGHT / 1000)
    with pytest.raises(InputError, match=message):
        crop(LIGHT, window=tuple(window))


@pytest.mark.parametrize("window", [[-1, 0, 4, 4], [0, 0, 0, 4], [0, 0, 4], [0, 0, 4.5, 4]])
def test_a_window_of_no_pixels_is_refused(window: object) -> None:
    with pytest.raises(ValueError, match=r"whole pixels|4 values are needed|valid integer"):
        model_of(crop).model_validate({"window": window})
