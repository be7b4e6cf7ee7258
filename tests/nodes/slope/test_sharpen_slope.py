"""The camera's blur is undone on the slopes of a matt film, and only there."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.slope.sharpen_slope import MAX_CORRECTION, sharpen_slope

CLEAR, LENS = np.zeros(4, np.float32), np.full(8, 0.01, np.float32)
Y, X = np.mgrid[:60, :80].astype(np.float32)
FINE = 8
"""Samples of a pixel along either axis."""
INNER = np.s_[:, 8:-8, 8:-8]


def slopes_of(normal: F4) -> F4:
    return np.asarray(-normal[:2] / normal[2], np.float32)


def normals_of(slope: F4) -> F4:
    square = 1 + (slope * slope).sum(axis=0)
    return np.asarray(np.stack([-slope[0], -slope[1], np.ones_like(square)]) / np.sqrt(square))


def waves(by: int = 1) -> F4:
    """Slopes of waves, sampled `by` times a pixel."""
    y, x = np.mgrid[: 60 * by, : 80 * by] / np.float32(by)
    p, q = 0.6 * np.sin(x / 3) * np.cos(y / 5), 0.4 * np.cos(x / 4) * np.sin(y / 3)
    return np.asarray([p, q], np.float32)


WAVES = waves()


def blurred(slope: F4, deviation: float, by: int = 1) -> F4:
    """The slopes of the mean normals, as the light of a matt film shows them."""
    planes = [cv2.GaussianBlur(plane, (0, 0), by * deviation) for plane in normals_of(slope)]
    return slopes_of(np.stack(planes)[:, ::by, ::by])


@pytest.mark.parametrize("deviation", [0.4, 0.8])
def test_waves_of_a_matt_film_are_restored(deviation: float) -> None:
    seen = blurred(waves(FINE), deviation, FINE)
    restored = sharpen_slope(seen, deviation, 1.0, CLEAR)
    off, before = (np.sqrt(np.mean((each - WAVES)[INNER] ** 2)) for each in (restored, seen))
    assert off < 0.25 * before


def test_across_an_edge_a_slope_changes_by_no_more_than_the_limit() -> None:
    wall = np.stack([np.where(X < 40, 0, 4), 0 * X]).astype(np.float32)
    seen = blurred(wall, 1.0)
    change = np.abs(sharpen_slope(seen, 1.0, 1.0, CLEAR) - seen)
    limit = MAX_CORRECTION * (1 + (seen * seen).sum(axis=0))
    assert (change <= 1.001 * limit).all()
    assert (change > 0.99 * limit).any()


def test_a_resampled_image_shows_less_blur_than_its_edges() -> None:
    seen = blurred(waves(FINE), 0.5, FINE)
    change, less = (
        sharpen_slope(seen, 0.5, 1.0, CLEAR, lens) - seen for lens in (np.zeros_like(LENS), LENS)
    )
    np.testing.assert_allclose(less, (1 - 1 / 15 / 0.25) * change, atol=0.02 * np.abs(change).max())


@pytest.mark.parametrize(
    ("blur", "refraction", "diffuse"), [(0.0, 1.0, 0.0), (0.8, 1.5, 0.0), (0.8, 1.0, 0.2)]
)
def test_a_sharp_camera_a_coat_or_a_gel_that_diffuses_leaves_slopes_as_they_are(
    blur: float, refraction: float, diffuse: float
) -> None:
    assert sharpen_slope(WAVES, blur, refraction, CLEAR + np.float32(diffuse)) is WAVES
