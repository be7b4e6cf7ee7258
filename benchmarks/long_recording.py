"""What hours of recording cost: memory, disk and processor time.

    python benchmarks/long_recording.py --frames 12000

Frames of 640 x 480 (a smooth picture with a camera's noise) are recorded as fast as the disk
takes them, one a touch, into a folder that may hold 1 GB, the oldest file going.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from tactograph.graph import Provenance, Session
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.live.nodes.view.live_statistics import resident_mib
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.nodes.record import record

SIZE = (480, 640)
LEDS = 4
RATE = 30.0
NOISE = 1.5
NOBODY = Provenance({}, None, [], {}, {}, [], [])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--frames", type=int, default=12_000)
    count: int = parser.parse_args().frames
    rng = np.random.default_rng(0)
    picture = 120 + 40 * np.sin(np.arange(SIZE[1]) / 80) + np.zeros((SIZE[0], 1))
    pictures = [(picture + rng.normal(0, NOISE, SIZE)).astype(np.uint8) for _ in range(2 * LEDS)]
    image = np.zeros((LEDS, *SIZE), np.float32)
    session, spent = Session(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count + 1):
            data = pictures[number % len(pictures)]
            frame = RawFrame(number, 1 + number % LEDS, number / RATE, data)
            record(
                [frame], image, str(number), folder=Path(folder), file_mb=200, total_gb=1.0,
                when_full="oldest", wait=True, provenance=NOBODY, session=session,
            )  # fmt: skip
            if number % (count // 4) == 0:
                size = sum(file.stat().st_size for file in log_files(Path(folder)))
                print(
                    f"{number:>7} frames ({number / RATE / 60:5.1f} min of a camera): "
                    f"{resident_mib():.0f} MiB in memory, {size / 1e9:.2f} GB on the disk"
                )
        session.close()
    spent = time.process_time() - spent
    print(f"{1e3 * spent / count:.1f} ms of processor time a frame")


if __name__ == "__main__":
    main()
