"""`tactograph show` prints and draws all that is in a file, and refuses what it does not know."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from tactograph.graph import InputError, Provenance
from tactograph.graph.command import SIGPIPE_EXIT_CODE, run_command
from tactograph.graph.errors import WriteError
from tactograph.nodes.calibrate.kinds.calibration_kind import _dots
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.stream.touch import Touch
from tactograph.nodes.write.write_result import write_result
from tests.nodes.files.test_calibration_file import write as write_flashed

PROVENANCE = Provenance(
    {"name": "toy", "hash": "f00"}, None, [], {}, {"tactograph": "0"}, ["too bright"], [],
    {"lights": "bgr", "dark": None}, {"calibration": {"hash": "c0ffee"}},
)  # fmt: skip


Shown = Callable[[Path], str]


@pytest.fixture
def shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Shown:
    """What is printed of a file; pictures are drawn into a folder."""

    def show(file: Path) -> str:
        run_command(["show", str(file), "--out", str(tmp_path / "drawn")])
        return capsys.readouterr().out

    return show


@pytest.fixture
def result(tmp_path: Path) -> Path:
    level, image = np.zeros((8, 10), np.float32), np.ones((4, 8, 10), np.float32)
    lit = np.zeros((8, 10), np.uint8)
    touch = Touch(level, image, 0.1, metrics={"contacts": 0.0}, layers={"shadow": lit})
    write_result(touch, folder=tmp_path / "out", pictures=False, provenance=PROVENANCE)
    return tmp_path / "out"


def test_a_calibration_shows_verdict_values_and_picture(tmp_path: Path, shown: Shown) -> None:
    file = tmp_path / "cal.npz"
    write_flashed(file, doubts=["LED 1 is 1.2 m away"], lights="bgr")
    printed = shown(file)
    assert "verdict: doubtful\n  LED 1 is 1.2 m away\n" in printed
    assert "lights=bgr" in printed
    assert "date: 20" in printed
    assert "entries  50" in printed
    assert re.search(r"pixel_size +0\.07  \[mm/px\]", printed)
    picture = cv2.imread(str(tmp_path / "drawn" / "cal.png"))
    assert picture is not None
    assert np.ptp(picture) > 200


def test_leds_that_share_a_place_share_a_label() -> None:
    axes = Figure().subplots()
    x, y = np.array([30.0, 0, 30.5, -30], np.float32), np.array([40.0, 50, 40, 40], np.float32)
    _dots(axes, x, y, x, y)
    assert [text.get_text() for text in axes.texts] == ["1, 3", "2", "4"]


def test_a_closed_pipe_is_no_error_of_the_node(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    write_flashed(file)
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "tactograph", "show", str(file)]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (SIGPIPE_EXIT_CODE, "")


def test_a_result_shows_figures_and_warnings(result: Path, shown: Shown) -> None:
    printed = shown(result)
    assert "made by: graph toy [f00], version 0\nparams: lights=bgr\n" in printed
    assert "warnings:\n  too bright\n" in printed
    assert "calibration: hash c0ffee\n" in printed
    assert "contacts  0" in printed


def test_captures_show_their_light(tmp_path: Path, shown: Shown) -> None:
    images = np.full((4, 24, 32), 102, np.uint8)
    images[:, 0, 0] = 204
    for touch in "a", "b":
        (tmp_path / "touches" / touch).mkdir(parents=True)
        for led, image in enumerate(images, start=1):
            ImageFile(tmp_path / "touches" / touch / f"led{led}.png").write(image)
    printed = shown(tmp_path / "touches" / "a")
    assert "images: 4 lights of 32 x 24 pixels" in printed
    assert "  4: median 0.400, brightest 0.800" in printed
    assert "2 captures; the first:" in shown(tmp_path / "touches")


@pytest.mark.parametrize("name", ["notes.txt", "cal.npz", "result.json", "frames.mcap", "folder"])
def test_anything_else_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    if file.suffix:
        file.write_text("something else")
    else:
        file.mkdir()
    with pytest.raises(InputError, match=name) as error:
        run_command(["show", str(file)])
    assert not {"\n", "`"} & {*str(error.value)}  # nor a name that only the node inside has


ESCAPES = "\x1b[31mred\x07\nTrust: 1\r\u202e\ud800"


def test_texts_of_files_cannot_command_the_terminal(tmp_path: Path, shown: Shown) -> None:
    calibration, result = tmp_path / "cal.npz", tmp_path / "result.json"
    write_flashed(calibration, doubts=[ESCAPES, "a" * 10**6], lights=ESCAPES)
    record = {"graph": {"name": ESCAPES}, "warnings": [ESCAPES], "metrics": {ESCAPES: 1.0}}
    result.write_text(json.dumps(record))
    for file in (calibration, result):
        text = shown(file)
        assert "red" in text
        assert text.encode()
        assert not any(mark in text for mark in "\x1b\x07\r\u202e")
        assert not any(line.startswith("Trust") for line in text.splitlines())
        assert len(text) < 10**4


def test_of_many_doubts_the_first_are_shown(tmp_path: Path, shown: Shown) -> None:
    file = tmp_path / "cal.npz"
    write_flashed(file, doubts=[f"doubt {n}." for n in range(10**4)])
    text = shown(file)
    assert "doubt 19." in text
    assert "doubt 20." not in text
    assert "… and 9980 more" in text


def test_a_result_tells_which_files_are_not_as_written(result: Path, shown: Shown) -> None:
    assert "not as they were written" not in shown(result)
    (result / "shadow.png").unlink()
    (result / "height.tiff").write_bytes(b"another")
    printed = shown(result)
    assert "not as they were written:\n  height.tiff: changed\n  shadow.png: missing\n" in printed


@pytest.mark.parametrize("out", ["taken/drawn", "a" * 300])
def test_pictures_that_cannot_be_written_are_reported(tmp_path: Path, out: str) -> None:
    (tmp_path / "taken").write_text("")
    write_flashed(tmp_path / "cal.npz")
    with pytest.raises(WriteError, match="cannot be written"):
        run_command(["show", str(tmp_path / "cal.npz"), "--out", str(tmp_path / out)])


@pytest.mark.parametrize("name", ["none.npz", "a" * 5000])
def test_a_missing_or_impossible_file_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        run_command(["show", name])
