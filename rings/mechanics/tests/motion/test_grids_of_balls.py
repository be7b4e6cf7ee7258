"""Poses and stitched surfaces of a real sensor's scans of grids of balls."""

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import label

from tactograph.rings.mechanics.nodes.motion.stitch import stitch
from tactograph.rings.mechanics.nodes.motion.track_pose import track_pose
from tests.pipelines.test_films import BALL_PX, PIXEL_MM, Sensor, scans, sensor

__all__ = ["scans", "sensor"]


@pytest.mark.slow
def test_a_grid_of_balls_is_found_where_the_vendor_marked_it(
    sensor: Sensor, scans: list[dict[str, Any]]
) -> None:
    """Shift and turn from one scan to the other; each ball of a grid is like the next."""
    first, second = scans
    key = track_pose(first["height"], first["contact"], PIXEL_MM)
    found = track_pose(second["height"], second["contact"], PIXEL_MM, None, key.key, key.memory)
    turn = np.radians(found.pose[5])
    middle = (np.array(first["height"].shape[::-1]) - 1) / 2
    one, two = (PIXEL_MM * (c - middle) for c in (sensor.first_centres, sensor.centres))
    moved = one @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    moved += found.pose[:2]
    away = np.linalg.norm(moved[:, None] - two, axis=2)
    alike = away.min(axis=1) < 0.1
    apart = (two[away.argmin(axis=1)] - moved)[alike]
    at = moved[alike] - moved[alike].mean(axis=0)
    turned = np.degrees(np.sum(at[:, 0] * apart[:, 1] - at[:, 1] * apart[:, 0]) / np.sum(at**2))
    assert alike.sum() > 40
    assert np.all(np.abs(apart.mean(axis=0)) < 0.003)
    assert abs(turned) < 0.02


@pytest.mark.slow
def test_the_pitch_of_a_grid_continues_across_a_seam(scans: list[dict[str, Any]]) -> None:
    """The left part of one scan and the right part of the other as one surface."""
    left, right = (scan["height"].copy() for scan in scans)
    width = left.shape[1]
    left[:, round(0.65 * width) :] = np.nan
    right[:, : round(0.35 * width)] = np.nan
    unknown = np.full((2, *left.shape), np.nan, np.float32)
    heights = np.stack([left, right])
    settings = {"turn_deg": 3.0, "least_likeness": 0.5, "margin_px": 6}
    whole = stitch(heights, unknown, PIXEL_MM, ["left", "right"], **settings)
    q, p = np.gradient(whole.height.astype(np.float64), PIXEL_MM)
    length = np.sqrt(1 + p * p + q * q)
    caps, count = label(np.isfinite(length))
    middles, sources = [], []
    for number in range(1, count + 1):
        y, x = np.nonzero(caps == number)
        if len(x) > 150:
            tilt = p[y, x] / length[y, x], q[y, x] / length[y, x]
            middles.append([np.median(a + BALL_PX * c) for a, c in zip((x, y), tilt, strict=True)])
            sources.append(whole.source[y, x].mean())
    apart = PIXEL_MM * np.linalg.norm(np.array(middles)[:, None] - np.array(middles), axis=2)
    across = np.subtract.outer(sources, sources) > 0.5
    assert np.mean(apart[across & (np.abs(apart - 1) < 0.1)]) == pytest.approx(1, abs=0.002)
