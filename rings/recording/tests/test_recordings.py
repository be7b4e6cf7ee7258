"""Recordings in whole graphs: through the engine, with what it keeps and closes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from rings.recording.tests.recordings import (
    LEDS,
    light_of,
    make_cycle,
    make_recording,
    read_numbers,
    record_touch,
)
from tactograph.graph import InputError, Session
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapReader
from tests.graph.conftest import Command, one_line, tactograph

__all__ = ["tactograph"]
GRAPH = """
format: 1
title: Replay, record again, hand on
params:
  recording: {kind: path}
  again:     {kind: path}
prefer: [numpy]
nodes:
  frames: {op: replay, with: {recording: $recording, speed: 0.0, refresh: cycle}}
  pixel:  {op: pixel_size, with: {mm: 0.1}}
  smooth: {op: blur, in: {light: frames.image}}
  keep:
    op: record
    in: {new: frames.new, image: frames.image, name: frames.name, state: frames.state}
    with: {folder: $again}
outputs: {smooth: smooth}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    file = tmp_path / "again.yaml"
    file.write_text(GRAPH)
    return file


def test_a_replayed_stream_runs_through_a_graph_and_is_recorded(
    tmp_path: Path, graph: Path
) -> None:
    frames = make_recording(tmp_path / "first", 3)
    arguments = {"recording": tmp_path / "first", "again": tmp_path / "again"}
    with open_pipeline(str(graph), arguments) as pipeline:
        heights = [result["smooth"] for result in pipeline.items()]
    assert len(heights) == 3
    assert np.abs(heights[1] - light_of(frames[LEDS : 2 * LEDS])).mean() < 0.3
    # The stream's end ends the file: it has its index.
    assert read_numbers(tmp_path / "again") == [frame.number for frame in frames]
    (path,) = log_files(tmp_path / "again")
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")
    file = McapReader(path)
    assert next(file.messages())
    assert "Replay, record again" in file.about["graph"]


def test_a_file_that_is_not_a_recording_is_one_line_and_exit_code_2(
    tmp_path: Path, graph: Path, tactograph: Command
) -> None:
    (tmp_path / "notes.mcap").write_text("not this\n")
    words = ["run", str(graph), f"recording={tmp_path / 'notes.mcap'}", f"again={tmp_path / 'a'}"]
    assert "is no MCAP file" in one_line(tactograph(*words))


def test_a_torn_end_is_a_warning(tmp_path: Path, graph: Path, tactograph: Command) -> None:
    # Of more frames than are read ahead of the first touch.
    make_recording(tmp_path / "first", 15)
    (path,) = log_files(tmp_path / "first")
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 4 // 5])
    words = ["run", str(graph), f"recording={tmp_path / 'first'}", f"again={tmp_path / 'again'}"]
    outcome = tactograph(*words)
    assert outcome.code == 0
    assert outcome.err.count("ends early, as after a power cut") == 1
    assert outcome.out.endswith("1 warning, see above\n")


def test_recording_without_its_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(InputError, match=r"needs mcap: pip install 'tactograph\[mcap\]'"):
        record_touch(Session(), make_cycle(0), "0", folder=Path())


def test_a_recording_shows_how_long_and_what(tmp_path: Path, tactograph: Command) -> None:
    make_recording(tmp_path, 3)
    (file,) = tmp_path.glob("*.mcap")
    printed = tactograph("show", file).out
    assert "recording, 0." in printed
    assert all(f"/led{led}/image_raw  3" in printed for led in range(1, LEDS + 1))
