"""A recording gives the touches again that the camera gave."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from rings.recording.tests.recordings import (
    LEDS,
    RATE,
    SIZE,
    light_of,
    make_cycle,
    make_recording,
    record_cycles,
)
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.recording.files import mcap_read
from tactograph.rings.recording.files.mcap_log import Limits, McapLog, log_files
from tactograph.rings.recording.files.mcap_read import McapReader
from tactograph.rings.recording.files.ros_messages import image_message, text_message
from tactograph.rings.recording.nodes.replay import replay


def test_every_cycle_is_replayed_unchanged(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 3)
    touches = list(replay(recording=tmp_path, speed=0, refresh="cycle"))
    assert [touch.name for touch in touches] == ["000001", "000002", "000003"]
    for number, touch in enumerate(touches):
        cycle = frames[LEDS * number : LEDS * (number + 1)]
        np.testing.assert_allclose(touch.image, light_of(cycle), atol=1e-6)
        assert [f.number for f in touch.new] == [f.number for f in cycle]
        assert touch.truth is None
    assert touches[-1].state.frames == 3 * LEDS
    assert touches[-1].state.settings == {"exposure": 12, "bits": None}


def test_a_rolling_touch_comes_with_every_frame_after_the_first_cycle(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 3)
    touches = list(replay(recording=tmp_path, speed=0))
    assert len(touches) == 3 * LEDS - (LEDS - 1)
    assert [len(touch.new) for touch in touches] == [LEDS] + [1] * (2 * LEDS)
    np.testing.assert_allclose(touches[2].image, light_of(frames[2 : 2 + LEDS]), atol=1e-6)


def test_times_are_those_of_the_exposures(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 2)
    touches = list(replay(recording=tmp_path, speed=0, refresh="cycle"))
    recorded = [frames[LEDS - 1].time, frames[2 * LEDS - 1].time]
    np.testing.assert_allclose([t.time for t in touches], recorded, atol=0.01)
    assert touches[1].time - touches[0].time == pytest.approx(recorded[1] - recorded[0], abs=1e-6)


def test_a_recording_of_a_replay_is_the_same_recording(tmp_path: Path) -> None:
    make_recording(tmp_path / "first", 3)
    replayed = replay(recording=tmp_path / "first", speed=0)
    record_cycles(tmp_path / "second", *(touch.new for touch in replayed))
    both = [list(replay(recording=tmp_path / n, speed=0)) for n in ("first", "second")]
    assert len(both[0]) == len(both[1])
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one.image, other.image)
        assert one.time == pytest.approx(other.time, abs=0.01)


@pytest.mark.parametrize(("speed", "seconds"), [(1.0, 11 / RATE), (4.0, 11 / RATE / 4)])
def test_time_passes_at_the_speed_asked_for(tmp_path: Path, speed: float, seconds: float) -> None:
    make_recording(tmp_path, 3)
    start = time.monotonic()
    stream = replay(recording=tmp_path, speed=speed)
    next(stream)
    first = time.monotonic()
    *_, _last = stream
    # From frame 3, which completes the first touch, to frame 11.
    assert time.monotonic() - first >= 8 / 11 * seconds - 0.02
    assert time.monotonic() - start >= seconds - 0.02


def test_nobody_waits_for_a_pause_between_two_recordings(tmp_path: Path) -> None:
    start = time.monotonic()
    record_cycles(tmp_path, make_cycle(0, began=start - 7200), make_cycle(1, began=start))
    touches = list(replay(recording=tmp_path, speed=1))
    assert time.monotonic() - start < 5
    # Frames from before the pause are not mixed with those after it.
    assert [touch.name for touch in touches] == ["000001", "000002"]


def test_files_follow_one_another_without_a_gap(tmp_path: Path) -> None:
    frames = make_recording(tmp_path, 12, file_mb=0.01)
    assert len(log_files(tmp_path)) > 2
    touches = list(replay(recording=tmp_path, speed=0))
    assert [f.number for touch in touches for f in touch.new] == [f.number for f in frames]


def test_missing_frames_are_counted_and_nothing_stale_is_reconstructed(tmp_path: Path) -> None:
    record_cycles(tmp_path, *map(make_cycle, (0, 1, 9, 10)))
    touches = list(replay(recording=tmp_path, speed=0, refresh="cycle"))
    assert len(touches) == 4
    assert [touch.state.dropped for touch in touches] == [0, 0, 7 * LEDS, 7 * LEDS]
    np.testing.assert_allclose(touches[2].image, light_of(make_cycle(9)), atol=1e-6)


def test_a_camera_of_twelve_bits_has_its_own_full_scale(tmp_path: Path) -> None:
    frames = [replace(frame, data=frame.data >> 4) for frame in make_cycle(0, dtype=np.uint16)]
    record_cycles(tmp_path, frames, bits=12)
    (touch,) = replay(recording=tmp_path, speed=0)
    np.testing.assert_allclose(touch.image, [f.data / np.float32(4095) for f in frames], atol=1e-6)


def test_light_with_all_leds_off_is_taken_off_less_the_cameras_own_dark(tmp_path: Path) -> None:
    began = time.monotonic()
    frames = [RawFrame(0, 0, began, np.full(SIZE, 20, np.uint8))]
    frames += [
        RawFrame(k, k, began + k / RATE, np.full(SIZE, 100 + k, np.uint8))
        for k in range(1, LEDS + 1)
    ]
    record_cycles(tmp_path, frames[1:])
    (plain,) = replay(recording=tmp_path, speed=0)
    record_cycles(tmp_path / "ambient", frames)
    (touch,) = replay(recording=tmp_path / "ambient", speed=0)
    np.testing.assert_allclose(touch.image, plain.image - 20 / 255, atol=1e-6)


def test_a_torn_end_is_reported_once_and_everything_before_it_replayed(tmp_path: Path) -> None:
    make_recording(tmp_path, 3)
    (path,) = log_files(tmp_path)
    path.write_bytes(path.read_bytes()[:-5000])
    with collect_warnings([]) as notes:
        touches = list(replay(recording=tmp_path, speed=0))
    assert len(notes) == 1
    assert path.name in notes[0]
    assert "ends early" in notes[0]
    assert 0 < len(touches) < 3 * LEDS - 3


def test_an_end_torn_between_two_records_is_reported(tmp_path: Path) -> None:
    make_recording(tmp_path, 3)
    (path,) = log_files(tmp_path)
    content = path.read_bytes()
    at, opcode = len(mcap_read.MCAP_MAGIC), 0
    while opcode != Opcode.DATA_END:
        end = at
        opcode, length = mcap_read._OPCODE_AND_LENGTH.unpack_from(content, at)
        at += mcap_read._OPCODE_AND_LENGTH.size + length
    path.write_bytes(content[:end])
    with collect_warnings([]) as notes:
        list(replay(recording=tmp_path, speed=0))
    assert notes == [
        f"{path}: ends early, as after a power cut: 0 bytes cannot be read; 12 frames can"
    ]


def test_an_empty_file_among_others_does_no_harm(tmp_path: Path) -> None:
    make_recording(tmp_path, 1)
    with collect_warnings([]) as notes:
        list(replay(recording=tmp_path, speed=0))
        assert notes == [], "a whole recording gives no warning"
        (tmp_path / "000002_now.mcap").write_bytes(b"")
        assert len(list(replay(recording=tmp_path, speed=0))) == 1
    assert len(notes) == 1


def make_foreign(folder: Path, topic: str) -> None:
    log = McapLog(folder, {}, Limits())
    image = np.zeros(SIZE, np.uint8)
    log.put([image_message(topic, 1, image, "x"), text_message("/said", 1, "hello")])
    log.close()


def test_a_foreign_file_is_named_in_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    text = tmp_path / "notes.mcap"
    text.write_text("not this\n")
    make_foreign(tmp_path / "robot", "/camera")
    make_foreign(tmp_path / "copy", "/led1/image_raw")
    for path, message in {
        tmp_path / "nowhere": "no such recording",
        empty: "holds no .mcap file",
        text: "is no MCAP file",
        tmp_path / "robot": "no recording of camera frames; it holds /camera, /said",
        tmp_path / "copy": "not written by tactograph",
    }.items():
        with pytest.raises(InputError) as caught:
            list(replay(recording=path, speed=0))
        assert message in str(caught.value)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_recording_of_which_nothing_is_left_is_an_error(tmp_path: Path) -> None:
    make_recording(tmp_path, 1)
    (path,) = log_files(tmp_path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match="holds no frame"):
        list(replay(recording=tmp_path, speed=0))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_would_fill_the_memory_is_lost_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str
) -> None:
    monkeypatch.setattr(mcap_read, "MAX_BYTES", 100_000)
    kind = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}[compression]
    file = tmp_path / "bomb.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, compression=kind)
        writer.start()
        channel = writer.register_channel("/led1/image_raw", "cdr", 0)
        writer.add_message(channel, 0, bytes(1_000_000), 0)
        writer.finish()
    found = McapReader(file)
    assert list(found.messages()) == []
    assert found.lost > 0


@pytest.mark.parametrize("set_by_s", [-3600, 3600])
@pytest.mark.parametrize("speed", [0.0, 1000.0])
def test_a_clock_that_was_set_between_two_recordings_mixes_no_touch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, set_by_s: int, speed: float
) -> None:
    frames = make_recording(tmp_path, 2)
    day = time.time_ns
    with monkeypatch.context() as during:
        during.setattr(time, "time_ns", lambda: day() + set_by_s * 10**9)
        make_recording(tmp_path, 2)
    touches = list(replay(recording=tmp_path, speed=speed))
    assert len(touches) == 2 * (2 * LEDS - (LEDS - 1))
    half = len(touches) // 2
    for touch, again in zip(touches[:half], touches[half:], strict=True):
        np.testing.assert_array_equal(touch.image, again.image)
    np.testing.assert_allclose(touches[half].image, light_of(frames[:LEDS]), atol=1e-6)
    apart = touches[half].time - touches[0].time
    assert apart == pytest.approx(set_by_s, abs=60)
