"""A video of a simulated one-shot sensor, for benchmarks that shall not pay for simulating it.

    python benchmarks/oneshot_film.py film.avi 640x480 14

A ball is pressed into the film and rolled around, 30 frames a second, each a JPEG as a camera of
this kind sends it.  The film is that of ``camera=simulated`` with a preset of this size.
"""

import argparse
from pathlib import Path

import cv2

from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)

RATE = 30
QUALITY = 95
WIDE_MM = 320 * 0.0634
"""What a GelSight Mini sees of its film."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("size")
    parser.add_argument("seconds", type=float)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    scene = ColourScene(width_px=width, height_px=height, pixel_size_mm=WIDE_MM / width)
    sensor = SimulatedColourSensor(scene, start=0.0)
    code = cv2.VideoWriter.fourcc(*"MJPG")
    video = cv2.VideoWriter(str(arguments.file), cv2.CAP_OPENCV_MJPEG, code, RATE, (width, height))
    video.set(cv2.VIDEOWRITER_PROP_QUALITY, QUALITY)
    for number in range(round(arguments.seconds * RATE)):
        video.write(sensor.picture(number / RATE, number))
    video.release()


if __name__ == "__main__":
    main()
