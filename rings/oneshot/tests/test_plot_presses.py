"""A calibration by many presses draws where they lie and how far off each comes out."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.rings.oneshot.nodes.presses.plot_presses import plot_presses


def test_contacts_and_their_errors_are_drawn(tmp_path: Path) -> None:
    flat = np.full((3, 60, 80), 0.5, np.float32)
    circle = np.array([[20, 20, 8], [60, 30, 9], [40, 40, 8], [0, 0, 0]], np.float32)
    kept, errors = np.array([1, 1, 0, 0], np.uint8), np.array([0.5, 2, 0, 0], np.float32)
    header = {"verdict": "nothing speaks against it", "advice": "press deeper"}
    drawn = []
    for used in (kept, 0 * kept):
        plot_presses(flat, circle, used, errors, file=tmp_path / "cal.npz", **header)
        drawn.append(cv2.imread(str(tmp_path / "cal.png")))
    assert drawn[0].shape == (500, 1200, 3)
    blue = [
        np.count_nonzero((picture[..., 0] > 200) & (picture[..., 2] < 100)) for picture in drawn
    ]
    assert blue[0] > 1000 > 10 > blue[1]
