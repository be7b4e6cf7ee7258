"""What a frame of the live stream costs the host: to be simulated, and to be matched to its LED.

    python benchmarks/live_frames.py

Of the sensor of `live.sh`, medians of many frames while its ball goes down and up.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import TypeVar

import numpy as np

from tactograph.rings.frames.rest_film import make_film
from tactograph.rings.live.nodes.simulated.simulated_sensor import Scene, SimulatedSensor
from tactograph.rings.live.nodes.touches._match_frames import Matcher

Value = TypeVar("Value")
RATE, FRAMES = 60.0, 480
SCENE = Scene(
    pixel_size_mm=1 / 28, slant_deg=33, distance_mm=60, radius_mm=4, depth_mm=1, path_mm=3
)


def main() -> None:
    sensor = SimulatedSensor(SCENE, start=0.0)
    count = len(sensor.lights)
    shares = np.broadcast_to(np.eye(count, dtype=np.float32)[:, :, None], (count, count, 480))
    rest = [np.mean([sensor.image(one, 0.0, n) for n in range(8)], axis=0) for one in shares]
    film = make_film(np.stack(rest).astype(np.float32) / np.float32(255))
    matcher = Matcher(film, tuple(range(1, count + 1)), RATE)
    simulated, matched = [], []
    for number in range(FRAMES):
        moment, one = number / RATE, list(shares[number % count])
        frame, spent = timed(lambda one=one, at=moment, n=number: sensor.image(one, at, n))
        simulated.append(spent)
        _, spent = timed(lambda frame=frame, at=moment: matcher.match(frame, at))
        matched.append(spent)
    print(f"simulated in {median(simulated):.2f} ms, matched in {median(matched):.2f} ms a frame")


def timed(do: Callable[[], Value]) -> tuple[Value, float]:
    """What a function returns, and the milliseconds that it took."""
    start = time.perf_counter()
    value = do()
    return value, 1e3 * (time.perf_counter() - start)


if __name__ == "__main__":
    main()
