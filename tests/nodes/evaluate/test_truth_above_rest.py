"""The truth is the height above the film at rest, which capture or calibration may know."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.nodes.capture.read_capture import Layout, read_capture
from tactograph.nodes.evaluate.truth_above_rest import truth_above_rest

STRAIGHT = np.zeros(8, np.float32)
TRUTH = np.full((6, 8), 3.0, np.float32)


def test_the_film_at_rest_is_subtracted_from_the_truth() -> None:
    rest, of_capture = TRUTH - 1, TRUTH - 2
    assert truth_above_rest(STRAIGHT) is None
    assert truth_above_rest(STRAIGHT, TRUTH) is TRUTH
    np.testing.assert_array_equal(truth_above_rest(STRAIGHT, TRUTH, None, rest), 1)
    np.testing.assert_array_equal(truth_above_rest(STRAIGHT, TRUTH, of_capture, rest), 2)


def test_a_capture_knows_the_true_film_at_rest_of_its_folder(tmp_path: Path) -> None:
    touch = tmp_path / "touch"
    touch.mkdir()
    for led in (1, 2, 3):
        cv2.imwrite(str(touch / f"led{led}.png"), np.full((6, 8), 90, np.uint8))
    np.save(tmp_path / "rest_height_mm.npy", TRUTH - 2)
    (alone,) = read_capture(folder=touch, layout=Layout())
    assert alone.truth_rest is None
    np.save(touch / "truth_height_mm.npy", TRUTH)
    (capture,) = read_capture(folder=touch, layout=Layout())
    np.testing.assert_array_equal(capture.truth_rest, TRUTH - 2)
