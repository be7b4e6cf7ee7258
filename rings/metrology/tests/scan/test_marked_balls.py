"""Balls that a scan marks."""

from pathlib import Path

import numpy as np

from tactograph.nodes.calibrate.ball.ball_slopes import ball_slopes
from tactograph.nodes.calibrate.ball.find_balls import find_balls
from tactograph.nodes.capture.read_balls import read_balls
from tactograph.nodes.simulate.render import render
from tests.nodes.calibrate.ball.test_many_presses import write
from tests.nodes.calibrate.lights.test_calibrate_lights import BLANK, FILM, PIXEL, RING, SIZE


def test_the_balls_that_are_marked_in_a_scan_are_found_there(tmp_path: Path) -> None:
    """Marks are some pixels off, and a scan knows radius and pixel size."""
    places = [(40.0, 35.0), (110.0, 36.0), (39.0, 85.0), (109.0, 86.0)]
    height = FILM.copy()
    for x, y in places:
        centre = np.array([x, y], np.float32)
        ball = ball_slopes(BLANK, centre, 18.0, PIXEL, radius_mm=2.0, margin_px=0.0)
        height = np.maximum(height, ball.height)
    light = render(height, PIXEL, RING, samples=2).light
    write(tmp_path / "scan", light)
    marks = "".join(
        f"  - {{type: GridCircle, gx: {k % 2}, gy: {k // 2}, x: {x - 2}, y: {y + 1}, r: 20}}\n"
        for k, (x, y) in enumerate(places)
    )
    (tmp_path / "scan" / "scan.yaml").write_text(
        f"images: [led1.png, led2.png, led3.png, led4.png]\nmmperpixel: {PIXEL}\n"
        f"calibradius: 2\ncrop: [0, 0, 0, 0]\nannotations:\n{marks}"
    )
    taken = read_balls(folder=tmp_path / "scan", crop=(10, 10, SIZE[1], SIZE[0]))
    assert (taken.radius.tolist(), taken.pixel_size) == ([2.0], PIXEL)
    flat = 0.6 * render(FILM, PIXEL, RING).light[:, 10:, 10:]
    found = find_balls(
        taken.image / flat, flat, taken.radius, taken.circles, taken.names, PIXEL, taken.marks
    )
    np.testing.assert_allclose(found.circle[:, :2] + 10, places, atol=0.3)
