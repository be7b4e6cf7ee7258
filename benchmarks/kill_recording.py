"""Kill a recording at random moments and count what can be read afterwards.

    python benchmarks/kill_recording.py --kills 200

Each time a process records frames of a camera (640 x 480, noise, so that nothing compresses) as
fast as it can, and says on a pipe after every touch that `record` has returned.  It is killed
(SIGKILL) at a random moment; then every touch that it had said has to be readable, pixel for
pixel.  Rotation every few files is on.  Exit code 1 if one is not.
"""

import argparse
import json
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Provenance, Session
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.recording.files.mcap_log import log_files, need_mcap
from tactograph.rings.recording.files.mcap_read import McapReader
from tactograph.rings.recording.files.ros_messages import read_image
from tactograph.rings.recording.nodes.record import record

LEDS = 4
NOBODY = Provenance({}, None, [], {}, {}, [], [])


@dataclass(frozen=True)
class Killed:
    """One recording that was killed: touches it had promised, found, and the torn end."""

    after_s: float
    promised: int
    found: int
    wrong: int
    torn_bytes: int
    files: int


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--longest", type=float, default=0.6, help="seconds until the kill")
    parser.add_argument("--size", type=int, nargs=2, default=(480, 640))
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rng = random.Random(args.seed)
    need_mcap()
    results = []
    with tempfile.TemporaryDirectory() as top:
        for number in range(args.kills):
            folder = Path(top) / f"{number:04}"
            results.append(kill_once(folder, rng.uniform(0.0, args.longest), tuple(args.size)))
    print_table(results)
    return int(any(r.found < r.promised or r.wrong for r in results))


def kill_once(folder: Path, after: float, size: tuple[int, int]) -> Killed:
    """Record into `folder`, kill the recording `after` seconds, and read what is there."""
    reader, writer = os.pipe()
    child = multiprocessing.get_context("fork").Process(target=_record, args=(folder, size, writer))
    child.start()
    os.close(writer)
    first = os.read(reader, 1)
    time.sleep(after)
    assert child.pid is not None
    os.kill(child.pid, signal.SIGKILL)
    child.join()
    output = first
    while part := os.read(reader, 4096):
        output += part
    os.close(reader)
    promised = output.count(b"\n")
    found, wrong, torn = _read(folder, size)
    return Killed(after, promised, found, wrong, torn, len(log_files(folder)))


def print_table(results: list[Killed]) -> None:
    rows = [
        ("kills", len(results)),
        ("touches promised before a kill", sum(r.promised for r in results)),
        ("of those not readable", sum(max(r.promised - r.found, 0) for r in results)),
        ("touches readable beyond those", sum(max(r.found - r.promised, 0) for r in results)),
        ("touches with a wrong pixel", sum(r.wrong for r in results)),
        ("kills in the middle of a write", sum(r.torn_bytes > 0 for r in results)),
        ("most bytes of an unfinished end", max(r.torn_bytes for r in results)),
        ("files", sum(r.files for r in results)),
    ]
    for name, value in rows:
        print(f"| {name:<32} | {value:>9,} |")


def _record(folder: Path, size: tuple[int, int], pipe: int) -> None:
    session = Session()
    for touch in range(10**6):
        frames = [
            RawFrame(LEDS * touch + k, k + 1, time.monotonic(), _pixels(LEDS * touch + k, size))
            for k in range(LEDS)
        ]
        image = np.zeros((LEDS, *size), np.float32)
        record(
            frames, image, str(touch), folder=folder, file_mb=20, provenance=NOBODY, session=session
        )
        os.write(pipe, b"\n")


def _pixels(number: int, size: tuple[int, int]) -> NDArray[np.uint8]:
    return np.random.default_rng(number).integers(0, 256, size, np.uint8)


def _read(folder: Path, size: tuple[int, int]) -> tuple[int, int, int]:
    """Whole touches, touches with a wrong pixel, and bytes of an unfinished end."""
    files = [McapReader(path) for path in log_files(folder)]
    found = wrong = 0
    for frames in _touches(files):
        right = len(frames) == LEDS and all(
            np.array_equal(image, _pixels(number, size)) for number, image in frames.items()
        )
        found += 1
        wrong += not right
    return found, wrong, sum(file.lost for file in files)


def _touches(files: list[McapReader]) -> Iterator[dict[int, NDArray[np.uint8]]]:
    """The frames of every touch whose name, which comes last, is there."""
    frames: dict[int, NDArray[np.uint8]] = {}
    for file in files:
        for message in file.messages():
            if message.topic != "/touch":
                frames[message.sequence] = read_image(message.body)
                continue
            yield {n: frames[n] for n in json.loads(message.body.data)["frames"] if n in frames}
            frames = {}


if __name__ == "__main__":
    sys.exit(main())
