"""People see the stream, with a screen and without; the stream does not depend on it."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from tactograph.graph import InputError, Session
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.stream.touch import LiveState, Touch
from tactograph.rings.live.nodes.view._live_picture import colour_height, draw_touch, round_up
from tactograph.rings.live.nodes.view.preview import preview
from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tests.nodes.touches import touch_of

SIZE = (48, 64)
HEIGHT = np.zeros(SIZE, np.float32)
HEIGHT[20:30, 20:40] = 0.7
SHADOW = np.zeros(SIZE, np.uint8)
SHADOW[:24, :32] = 0b0010
IMAGE = np.full((4, *SIZE), 0.5, np.float32)


def touch(**parts: Any) -> Touch:
    return touch_of(**{"height": HEIGHT, "image": IMAGE, "pixel": 0.1, "shadow": SHADOW, **parts})


def show(session: Session, **settings: Any) -> list[str]:
    """Preview one touch; return the messages."""
    settings = {"rate_hz": 1e9, **settings}
    with collect_warnings([]) as notes:
        preview(touch(), session=session, **settings)
    return notes


@pytest.fixture(autouse=True)
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")


def test_without_a_screen_the_picture_is_a_file_and_one_line_says_so(tmp_path: Path) -> None:
    session = Session()
    notes = show(session, folder=tmp_path)
    assert len(notes) == 1
    assert "no screen" in notes[0]
    assert str(tmp_path / "latest.png") in notes[0]
    assert show(session, folder=tmp_path) == []
    assert [file.name for file in tmp_path.iterdir()] == ["latest.png"]
    assert Image.open(tmp_path / "latest.png").mode == "RGB"


def test_opencv_without_windows_is_distinguished_from_a_missing_screen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setattr(cv2, "namedWindow", raise_not_implemented)
    (note,) = show(Session(), folder=tmp_path)
    assert "OpenCV has no windows" in note
    with pytest.raises(InputError, match="`where`=files"):
        show(Session(), folder=tmp_path, where="window")


def raise_not_implemented(*_: Any) -> None:
    raise cv2.error("The function is not implemented")


def test_touches_that_come_faster_than_the_rate_are_not_drawn(tmp_path: Path) -> None:
    session, drawn = Session(), set()
    for _ in range(5):
        show(session, folder=tmp_path, where="files", rate_hz=0.01)
        drawn.add((tmp_path / "latest.png").stat().st_ino)
    assert len(drawn) == 1


def test_a_folder_that_cannot_be_written_is_an_error_at_first_and_a_line_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file: cannot be written"):
        show(Session(), folder=tmp_path / "file", where="files")

    session = Session()
    show(session, folder=tmp_path, where="files")
    monkeypatch.setattr(Path, "write_bytes", disk_full)
    (note,) = show(session, folder=tmp_path, where="files")
    assert "No space left" in note
    assert "the stream goes on" in note
    assert show(session, folder=tmp_path, where="files") == []


def disk_full(*_: Any) -> None:
    raise OSError(28, "No space left on device")


class Screen:
    """OpenCV's windows, without a screen."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.open, self.key, self.pictures = False, -1, 0
        monkeypatch.setenv("DISPLAY", ":99")
        for name, function in {
            "namedWindow": self.named_window,
            "imshow": self.show,
            "waitKey": lambda _: self.key,
            "getWindowProperty": lambda *_: float(self.open),
            "destroyWindow": self.close,
            "destroyAllWindows": self.close,
            "resizeWindow": lambda *_: None,
        }.items():
            monkeypatch.setattr(cv2, name, function)

    def named_window(self, *_: Any) -> None:
        self.open = True

    def show(self, _: str, picture: Any) -> None:
        assert picture.dtype == np.uint8
        self.pictures += 1

    def close(self, *_: Any) -> None:
        self.open = False


@pytest.mark.parametrize("how", ["button", "key"])
def test_a_closed_window_stays_closed_and_the_stream_continues(
    monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    screen, session = Screen(monkeypatch), Session()
    assert show(session) == []
    assert show(session) == []
    assert screen.pictures == 2
    if how == "button":
        screen.open = False
    else:
        screen.key = ord("q")
    (note,) = show(session)
    assert "the window was closed; the stream goes on" in note
    pictures = screen.pictures
    assert show(session) == []
    assert screen.pictures == pictures
    session.close()


def test_the_window_goes_with_the_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    screen, session = Screen(monkeypatch), Session()
    show(session)
    assert screen.open
    session.close()
    assert not screen.open


def test_colours_say_the_height_and_a_grey_one_that_it_is_not_known() -> None:
    height = np.array([[0, 0.5, 1, 2, -1, np.nan]], np.float32)
    low, middle, top, above, below, unknown = colour_height(height, 1.0)[0].astype(int)
    assert low.sum() < middle.sum() < top.sum()
    assert (above == top).all()
    assert (below == low).all()
    assert np.ptp(unknown) == 0


def test_scales_end_at_round_numbers() -> None:
    values = (0.011, 0.5, 0.51, 1.0, 3.2, 70)
    assert [round_up(v) for v in values] == pytest.approx([0.02, 0.5, 1.0, 1.0, 5.0, 100.0])


def test_the_picture_shows_where_leds_are_dark_and_how_fast_touches_come() -> None:
    plain = draw_touch(touch(shadow=0 * SHADOW), 1.0, "")
    marked = draw_touch(touch(), 1.0, "")
    footed = draw_touch(touch(shadow=0 * SHADOW), 1.0, "30.0 touches/s")
    changed = (plain != marked).any(axis=-1)
    rows, columns = np.nonzero(changed)
    # A quarter of the picture at the lower right, of the colour of LED 2.
    assert changed.sum() == (rows.max() - rows.min() + 1) * (columns.max() - columns.min() + 1)
    red, _, blue = marked[changed].mean(axis=0)
    assert blue > red + 50
    assert np.nonzero((plain != footed).any(axis=-1))[0].min() > rows.max()


def test_markers_that_moved_are_arrows_over_the_cameras_image() -> None:
    plain = draw_touch(touch(), 1.0, "")
    rows, columns = HEIGHT.shape
    place = np.array([[columns / 2, rows / 2, 3.0]], np.float32)
    shift = np.array([[columns / 4, 0.0]], np.float32)
    tracks = MarkerTracks(place, shift, np.ones(1, np.uint8))
    drawn = draw_touch(touch(markers=tracks), 1.0, "")
    y, x = np.nonzero((plain != drawn).any(axis=-1))
    assert x.max() - x.min() > 2 * (y.max() - y.min())
    red, _, blue = drawn[y, x].mean(axis=0)
    assert red > blue + 50


def test_a_layer_that_is_chosen_is_drawn_beneath_the_image() -> None:
    contact, error = (HEIGHT > 0).astype(np.uint8), 0.01 * HEIGHT
    layers = {"contact": contact, "error": error}
    pictures = [draw_touch(touch(**layers), 1.0, "", "leds", name) for name in (None, *layers)]
    assert all((one != other).any() for one, other in pairwise(pictures))
    with pytest.raises(InputError, match=r"no such map; it has shadow, contact, error"):
        draw_touch(touch(**layers, unresolved=contact), 1.0, "", "leds", "unresolved")


def test_rates_drops_and_faults_are_in_the_footer(tmp_path: Path) -> None:
    from tactograph.rings.live.nodes.view.preview import _Files, _Preview

    shown = _Preview(_Files(tmp_path), 0.0)
    state = LiveState(frames=0, dropped=3)
    state.faults["swapped"] = 2
    for frames in range(0, 12, 4):
        shown.count(touch(state=LiveState(frames=frames)))
    text = shown.footer(state)
    for part in ("touches/s", "frames/s", "dropped 3", "swapped 2"):
        assert part in text
