"""Presses of a one-shot sensor in folders as people have them."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses
from tests.nodes.capture.test_captures_as_people_have_them import COLOURS, write


def test_presses_can_be_cropped(tmp_path: Path) -> None:
    write(tmp_path / "presses" / "0", ["touch.png"], COLOURS)
    write(tmp_path, ["film.png"], COLOURS[1:])
    part = {"crop": (2, 3, 10, 8), "smooth_px": 0.0}
    found = read_presses(folder=tmp_path / "presses", flat=tmp_path / "film.png", **part)
    assert np.array_equal(
        found.image[0], COLOURS[0, 3:8, 2:10].transpose(2, 0, 1) / np.float32(255)
    )
    assert found.flat.shape == (3, 5, 8)
    assert np.isnan(found.circle).all()


def test_a_press_may_say_where_its_ball_is(tmp_path: Path) -> None:
    folder = write(tmp_path / "presses" / "0", ["touch.png"], COLOURS)
    (folder / "capture.yaml").write_text("ball_center_px: [7.5, 5]\nball_contact_px: 3\n")
    write(tmp_path, ["film.png"], COLOURS[1:])
    found = read_presses(folder=tmp_path / "presses", flat=tmp_path / "film.png")
    assert found.circle.tolist() == [[7.5, 5, 3]]


def test_colour_frames_are_presses_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    write(tmp_path, ["sample_10.png", "sample_4.png", "ref.png"], COLOURS)
    presses = read_presses(folder=tmp_path, flat=tmp_path / "ref.png", smooth_px=0)
    assert presses.names == ["ref", "sample_4", "sample_10"]


def test_smoothing_the_film_at_rest_keeps_its_vignetting(tmp_path: Path) -> None:
    """A Gaussian alone made it some 0.0003 too dark, and touched film a dome."""
    y, x = np.mgrid[:60, :80] / 80
    plane = 0.8 - 0.5 * (x - 0.5) ** 2 - 0.4 * (y - 0.4) ** 2
    colours = np.array([1.0, 0.9, 0.8])[:, None, None] * plane
    cv2.imwrite(str(tmp_path / "film.png"), np.rint(np.dstack([*colours]) * 65535).astype("u2"))
    film = read_presses(flat=tmp_path / "film.png").flat
    assert np.abs(film - colours).max() < 1e-5
