"""What was recorded is there afterwards, whatever ends the recording."""

import errno
import json
import os
import queue
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from rings.recording.tests.recordings import (
    LEDS,
    SIZE,
    make_cycle,
    make_recording,
    read_numbers,
    record_cycles,
    record_touch,
)
from tactograph.graph import InputError, Session
from tactograph.graph.errors import collect_warnings
from tactograph.rings.recording.files import mcap_log
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapReader
from tests.fixtures import ROOT, python


def test_a_recording_is_read_by_the_libraries_of_ros_as_standard_images(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 3)
    (path,) = log_files(tmp_path)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        found = list(reader.iter_decoded_messages())
        assert reader.get_header().profile == "ros2"
    assert {c.message_encoding for c in summary.channels.values()} == {"cdr"}
    images = [(c.topic, m.sequence, d) for _, c, m, d in found if c.topic != "/touch"]
    assert [number for _, number, _ in images] == [frame.number for frame in frames]
    for frame, (topic, _, image) in zip(frames, images, strict=True):
        assert topic == f"/led{frame.led}/image_raw"
        assert (image.encoding, image.height, image.width) == ("mono8", *SIZE)
        assert image.data == frame.data.tobytes()
    stamps = [d.header.stamp.sec + 1e-9 * d.header.stamp.nanosec for _, _, d in images]
    exposed = [frame.time for frame in frames]
    assert np.ptp(np.subtract(stamps, exposed)) < 1e-6


def test_leds_and_settings_are_stored_with_the_frames(tmp_path: Path) -> None:
    make_recording(tmp_path, 2)
    file = McapReader(log_files(tmp_path)[0])
    touches = [json.loads(m.body.data) for m in file.messages() if m.topic == "/touch"]
    assert file.about["leds"] == str(LEDS)
    assert json.loads(file.about["graph"])["name"] == "toy"
    assert [touch["name"] for touch in touches] == ["000000", "000001"]
    assert touches[1]["frames"] == [4, 5, 6, 7]
    assert touches[1]["state"]["settings"] == {"exposure": 12, "bits": None}
    assert touches[1]["state"]["faults"] == {"lost": 2}


def test_sixteen_bits_stay_sixteen_bits(tmp_path: Path) -> None:
    frames = make_cycle(0, dtype=np.uint16)
    record_cycles(tmp_path, frames)
    images = [m.body for m in McapReader(log_files(tmp_path)[0]).messages() if m.topic != "/touch"]
    assert {image.encoding for image in images} == {"mono16"}
    assert [image.data for image in images] == [frame.data.tobytes() for frame in frames]


def test_a_touch_is_in_the_file_before_the_next_one(tmp_path: Path) -> None:
    session = Session()
    for touch in range(3):
        record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
        # The file is still open and has no end.
        assert read_numbers(tmp_path) == list(range(LEDS * (touch + 1)))
    session.close()


def test_a_file_cut_anywhere_gives_every_frame_before_the_cut(tmp_path: Path) -> None:
    make_recording(tmp_path, 2)
    (path,) = log_files(tmp_path)
    whole = path.read_bytes()
    ends = [where + len(part) for where, part in _chunks(whole)]
    # Every byte of the last frame and of the touch's name after it, and some of all others.
    lengths = {*range(0, len(whole), 61), *range(ends[-3], ends[-1] + 12), len(whole)}
    for length in sorted(lengths, reverse=True):
        os.truncate(path, length)
        found = sum(1 for _ in McapReader(path).messages())
        assert found == sum(end <= length for end in ends), length


def _chunks(whole: bytes) -> list[tuple[int, bytes]]:
    """Where the file's chunks stand; one for every frame and every touch's name."""
    at, found = 8, []
    while whole[at] != Opcode.DATA_END:
        size = 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
        if whole[at] == Opcode.CHUNK:
            found.append((at, whole[at : at + size]))
        at += size
    return found


def test_zeros_where_a_power_cut_left_no_data_are_taken_for_the_end(tmp_path: Path) -> None:
    make_recording(tmp_path, 2)
    (path,) = log_files(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-4000] + bytes(4000))
    file = McapReader(path)
    numbers = [m.sequence for m in file.messages() if m.topic != "/touch"]
    assert numbers == list(range(len(numbers)))
    assert 0 < len(numbers) < 2 * LEDS
    assert file.lost >= 4000


def test_a_damaged_frame_is_left_out_and_the_next_one_read(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 2)
    (path,) = log_files(tmp_path)
    whole = bytearray(path.read_bytes())
    # Noise is not compressed, so that the pixels stand in the file as they are.
    at = whole.find(frames[5].data.tobytes()[:64])
    assert at > 0
    whole[at] ^= 0xFF
    path.write_bytes(bytes(whole))
    file = McapReader(path)
    numbers = [m.sequence for m in file.messages() if m.topic != "/touch"]
    assert numbers == [0, 1, 2, 3, 4, 6, 7]
    assert file.lost > 0


def test_a_new_file_is_begun_when_one_is_large_enough(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 12, file_mb=0.01)
    files = log_files(tmp_path)
    assert len(files) > 2
    assert [f.name[:6] for f in files] == [f"{n:06}" for n in range(1, len(files) + 1)]
    assert read_numbers(tmp_path) == [frame.number for frame in frames]


def test_a_second_recording_continues_the_first(tmp_path: Path) -> None:
    make_recording(tmp_path, 1)
    before = {file: file.read_bytes() for file in log_files(tmp_path)}
    make_recording(tmp_path, 1)
    assert len(log_files(tmp_path)) == 2
    assert all(file.read_bytes() == content for file, content in before.items())


def test_the_oldest_files_go_where_the_folder_is_full(tmp_path: Path) -> None:
    make_recording(tmp_path, 60, total_gb=5e-5, when_full="oldest")
    files = log_files(tmp_path)
    assert sum(file.stat().st_size for file in files) < 5e4 + 2e4
    assert files[0].name[:6] != "000001"
    numbers = read_numbers(tmp_path)
    assert numbers == list(range(numbers[0], 60 * LEDS))
    assert len(numbers) > 2 * LEDS


def test_or_the_recording_stops_with_one_line(tmp_path: Path) -> None:
    with collect_warnings([]) as notes:
        make_recording(tmp_path, 60, total_gb=5e-5)
    assert len(notes) == 1
    assert "limit; recording has stopped" in notes[0]
    numbers = read_numbers(tmp_path)
    assert numbers == list(range(len(numbers)))
    assert sum(file.stat().st_size for file in log_files(tmp_path)) < 5e4 + 2e4


class Disk:
    """A disk that is full from some byte on, until it is cleared."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, space: int) -> None:
        self.space = space
        self._write = os.write
        monkeypatch.setattr(mcap_log.os, "write", self.write)

    def write(self, handle: int, data: Any) -> int:
        if not self.space:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = self._write(handle, data[: self.space])
        self.space -= written
        return written


def test_a_full_disk_costs_touches_but_neither_the_stream_nor_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_log, "RETRY_S", 0.0)
    disk = Disk(monkeypatch, 12_000)
    session, notes = Session(), []
    with collect_warnings(notes):
        for touch in range(5):
            record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
        assert len(notes) == 1
        assert "recording is interrupted, No space left on device" in notes[0]
        before = read_numbers(tmp_path)
        assert before == list(range(len(before)))
        assert len(before) % LEDS == 0 < len(before)
        # Trying again and again leaves no empty files behind.
        assert len(log_files(tmp_path)) == 1

        disk.space = 10**9
        for touch in range(5, 8):
            record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
    session.close()
    assert "recording again" in notes[1]
    assert len(notes) == 2
    assert read_numbers(tmp_path) == [*before, *range(5 * LEDS, 8 * LEDS)]


def test_a_disk_full_at_the_last_touch_is_reported_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_log, "PATIENCE_S", 0.0)
    session, notes = Session(), []
    record_touch(session, make_cycle(0), "0", folder=tmp_path)
    go = threading.Event()

    def write(handle: int, data: Any) -> int:
        go.wait(10)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(mcap_log.os, "write", write)
    with collect_warnings(notes):
        record_touch(session, make_cycle(1), "1", folder=tmp_path)
        assert notes == []
        go.set()
        session.close()
    assert len(notes) == 1
    assert "recording is interrupted, No space left on device" in notes[0]


def test_a_slow_disk_costs_touches_but_no_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_log, "PATIENCE_S", 0.0)
    monkeypatch.setattr(mcap_log, "MAX_WAITING_BYTES", 30_000)
    go, written = threading.Event(), os.write

    def write(handle: int, data: Any) -> int:
        go.wait(10)
        return written(handle, data)

    session, notes = Session(), []
    record_touch(session, make_cycle(0), "0", folder=tmp_path)
    monkeypatch.setattr(mcap_log.os, "write", write)
    with collect_warnings(notes):
        for touch in range(1, 50):
            record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
    go.set()
    session.close()
    assert notes == ["the disk is too slow for the recording; some touches are left out"]
    numbers = read_numbers(tmp_path)
    assert numbers[:LEDS] == [0, 1, 2, 3]
    assert LEDS < len(numbers) < 10 * LEDS
    assert len(numbers) % LEDS == 0


def test_the_disk_has_to_keep_every_touch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: queue.Queue[int] = queue.Queue()
    fsync = os.fsync

    def sync(handle: int) -> None:
        size = os.fstat(handle).st_size
        fsync(handle)
        kept.put(size)

    monkeypatch.setattr(mcap_log.os, "fsync", sync)
    session = Session()
    for touch in range(3):
        record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
        (path,) = log_files(tmp_path)
        while kept.get(timeout=10) < path.stat().st_size:
            pass
    session.close()


@pytest.mark.slow
def test_every_touch_is_there_after_a_kill(tmp_path: Path) -> None:
    script = ROOT / "benchmarks" / "kill_recording.py"
    sizes = ["--kills", "10", "--longest", "0.2", "--size", "60", "80"]
    lines = python(script, *sizes).stdout.splitlines()
    table = dict(line.strip("| ").split(" | ") for line in lines)
    figures = {name.strip(): int(value.replace(",", "")) for name, value in table.items()}
    assert figures["touches promised before a kill"] >= 10
    assert figures["of those not readable"] == 0


def test_a_stream_that_may_wait_loses_nothing_to_a_slow_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_log, "PATIENCE_S", 0.0)
    monkeypatch.setattr(mcap_log, "MAX_WAITING_BYTES", 30_000)
    written = os.write

    def write(handle: int, data: Any) -> int:
        time.sleep(0.005)
        return written(handle, data)

    monkeypatch.setattr(mcap_log.os, "write", write)
    frames = make_recording(tmp_path, 20, wait=True)
    assert read_numbers(tmp_path) == [frame.number for frame in frames]


def test_a_failure_that_nobody_thought_of_stops_the_recording_with_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> int:
        raise ZeroDivisionError("unthinkable")

    session, notes = Session(), []
    record_touch(session, make_cycle(0), "0", folder=tmp_path)
    monkeypatch.setattr(mcap_log.os, "write", fail)
    with collect_warnings(notes):
        for touch in range(1, 4):
            record_touch(session, make_cycle(touch), str(touch), folder=tmp_path)
    monkeypatch.undo()
    session.close()
    assert len(notes) == 1
    assert "recording has stopped: ZeroDivisionError: unthinkable" in notes[0]
    assert read_numbers(tmp_path) == [0, 1, 2, 3]


def test_a_folder_that_cannot_be_written_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file: cannot be written"):
        record_touch(Session(), make_cycle(0), "0", folder=tmp_path / "file")
