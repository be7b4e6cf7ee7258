"""Images passed in as arrays follow the rules of image files."""

import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tactograph.graph import Cache, InputError, load

BYTES = np.random.default_rng(3).integers(40, 200, (4, 12, 16)).astype(np.uint8)
LIGHT = BYTES / np.float32(255)
GRAPH = {
    "format": 1,
    "params": {"capture": {"kind": "path"}},
    "nodes": {"frames": {"op": "read_capture", "with": {"folder": "$capture"}}},
    "outputs": {"light": "frames.image"},
}


def read_stack(stack: Any) -> Any:
    return load(GRAPH, backend="numpy")(frames=stack)


def with_plane(stack: np.ndarray, plane: Any) -> np.ndarray:
    stack = stack.copy()
    stack[1] = plane
    return stack


@pytest.mark.parametrize(
    ("stack", "message"),
    [
        (BYTES.astype(np.float32), r"frames: has values from 4\d to 199.*stack / 255 for 8 bit"),
        (BYTES * 16.0, r"stack / 4095 for 12 bit"),
        (BYTES * 257.0, r"stack / 65535 for 16 bit"),
        (LIGHT - 0.3, r"from 0 to 1; np\.clip\(stack, 0, 1\)"),
        (LIGHT * 1.5, r"from 0 to 1; np\.clip\(stack, 0, 1\)"),
        (-LIGHT, r"has values from -0\.\d+ to -0\.\d+, but floats"),
        (with_plane(LIGHT, np.nan), "holds NaN or infinite values"),
        (with_plane(LIGHT, np.inf), "holds NaN or infinite values"),
    ],
    ids=["0..255", "0..4095", "0..65535", "shifted", "too bright", "negative", "NaN", "infinite"],
)
def test_floats_that_are_no_fractions_of_full_scale_are_refused(stack: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_stack(stack)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_fractions_of_full_scale_are_read_unchanged(kind: type) -> None:
    result = read_stack(LIGHT.astype(kind))
    np.testing.assert_array_equal(result["light"], LIGHT.astype(kind).astype(np.float32))
    assert result.warnings == []


@pytest.mark.parametrize(
    ("stack", "message"),
    [
        (np.zeros_like(BYTES), r"frames\[0\]: all black; is the LED on"),
        (np.zeros_like(LIGHT), r"frames\[0\]: all black; is the LED on"),
        (with_plane(BYTES, 0), r"frames\[1\]: all black; is the LED on"),
        (with_plane(BYTES, 2), r"frames\[1\]: too dark to measure, 2 of 255"),
        (with_plane(LIGHT, 0.004), r"frames\[1\]: too dark to measure, 0\.004 of 1"),
    ],
    ids=["bytes", "floats", "one LED", "dim LED", "dim floats"],
)
def test_dark_arrays_are_refused_like_dark_files(stack: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_stack(stack)


@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_bytes_in_a_wider_array_are_distinguished_from_darkness(kind: type) -> None:
    with pytest.raises(InputError, match=r"if it is 8 bit, hand in stack / np\.float32\(255\)"):
        read_stack(BYTES.astype(kind))


def test_twelve_bits_in_sixteen_give_one_warning() -> None:
    stack = BYTES.astype(np.uint16) * 16
    with pytest.warns(UserWarning, match="if it is 12 bit, hand in stack / ") as warned:
        result = read_stack(stack)
    assert len(warned) == len(result.warnings) == 1
    np.testing.assert_array_equal(result["light"], stack / np.float32(65535))


def test_a_loop_gives_a_warning_at_its_first_stack_alone() -> None:
    pipeline = load(GRAPH, backend="numpy")
    with pytest.warns(UserWarning, match="25.0% of the pixels are saturated"):
        pipeline(frames=with_plane(LIGHT, np.repeat([[1.0], [0.5], [0.5], [0.5]] * 3, 16, axis=1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        second = pipeline(frames=with_plane(LIGHT, 1.0))
    assert second.warnings == ["frames[1]: 100.0% of the pixels are saturated; expose shorter"]


def test_a_warning_of_one_stack_is_not_repeated_for_the_next() -> None:
    pipeline = load(GRAPH, backend="numpy", cache=Cache())
    with pytest.warns(UserWarning, match="12 bit"):
        pipeline(frames=BYTES.astype(np.uint16) * 16)
    assert pipeline(frames=BYTES).warnings == []


def test_arrays_and_files_of_the_same_pixels_are_the_same_light(tmp_path: Path) -> None:
    for number, plane in enumerate(BYTES, start=1):
        cv2.imwrite(str(tmp_path / f"led{number}.png"), plane)
    (from_files,) = load(GRAPH, capture=tmp_path, backend="numpy").items()
    np.testing.assert_array_equal(read_stack(BYTES)["light"], from_files["light"])
    np.testing.assert_array_equal(read_stack(LIGHT)["light"], from_files["light"])
