"""Draw the pictures of a stream, from a simulated sensor that is pressed once.

    python benchmarks/live_pictures.py [--out docs/pictures] [--work FOLDER]

The sensor's frames are recorded, and the recording goes through the graph `replay`, so that the
pictures do not depend on how fast the machine is.  `preview.png` is what the `preview` node
shows half-way down, `live_strip.png` heights over time and their errors.  With --work, the
recording and what `view_rerun` makes of it (`live.rrd`) stay there.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from tactograph.graph import Provenance, Session
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4, U1
from tactograph.nodes.stream.touch import Touch
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.live.nodes.simulated.simulated_sensor import Scene, SimulatedSensor
from tactograph.rings.live.nodes.view._live_picture import draw_touch, round_up
from tactograph.rings.recording.nodes.record import record

ROOT = Path(__file__).resolve().parents[1]
RATE = 30.0
PRESS_S = 4.0
SCENE = Scene(
    pixel_size_mm=0.03571428,
    radius_mm=3.0,
    depth_mm=2.0,
    path_mm=3.0,
    period_s=10.0,
    press_s=PRESS_S,
    slant_deg=50.0,
    distance_mm=60.0,
    exposure_s=0.02,
)
SHOWN_S = (0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2)
PREVIEW_S = 1.6
GRAPH = """
format: 1
extends: replay.yaml
title: Replay into pictures
params:
  rrd: {kind: path}
patch:
  - replace: save
    op: view_rerun
    in: {touch: touch}
    with: {viewer: none, file: $rrd, rate_hz: 1000000.0}
outputs: {pixel: cal.pixel_size, image: frames.image, time: frames.time}
"""


class Moment(NamedTuple):
    """One height of the stream, and the true one at its newest exposure."""

    seconds: float
    height: F4
    truth: F4
    shadow: U1
    image: F4
    pixel: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/pictures")
    parser.add_argument("--work", type=Path)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        work = args.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        sensor = SimulatedSensor(SCENE, start=0.0)
        record_press(sensor, work / "recording")
        stream = replay_press(sensor, work, calibrate(work))
    draw_strip([stream[round(s * RATE)] for s in SHOWN_S], args.out / "live_strip.png")
    draw_preview(stream[round(PREVIEW_S * RATE)], args.out / "preview.png")
    errors = [1e3 * float(np.sqrt(np.mean((s.height - s.truth) ** 2))) for s in stream.values()]
    print(f"{len(errors)} heights, RMSE {np.median(errors):.1f} um, at worst {max(errors):.1f} um")


def calibrate(work: Path) -> Path:
    """A calibration of the simulated sensor, made as a user makes one."""
    size = f"width_px={SCENE.width_px} height_px={SCENE.height_px}"
    light = f"slant_deg={SCENE.slant_deg} distance_mm={SCENE.distance_mm}"
    pixel = f"pixel_size_mm={SCENE.pixel_size_mm}"
    for words in (
        f"simulate radius_mm=7 {size} {light} {pixel} out={work}/ball",
        f"simulate_flat {size} {light} {pixel} out={work}/flat",
        f"calibrate capture={work}/ball flat={work}/flat ball_radius_mm=7 {pixel} "
        f"out={work}/cal.npz",
    ):
        command = [sys.executable, "-m", "tactograph.graph.command", "run", *words.split()]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return work / "cal.npz"


def record_press(sensor: SimulatedSensor, folder: Path) -> None:
    """Record the frames of one press, LED after LED."""
    shutil.rmtree(folder, ignore_errors=True)
    session = Session()
    leds = len(sensor.lights)
    image = np.zeros((leds, SCENE.height_px, SCENE.width_px), np.float32)
    nobody = Provenance({}, None, [], {}, {}, [], [])
    for number in range(round(PRESS_S * RATE)):
        frame = expose(sensor, number)
        record([frame], image, str(number), folder=folder, provenance=nobody, session=session)
    session.close()


def expose(sensor: SimulatedSensor, number: int) -> RawFrame:
    """Frame `number`, whose exposure ends at number / RATE."""
    led = number % len(sensor.lights)
    shares = [np.full(SCENE.height_px, k == led, np.float32) for k in range(len(sensor.lights))]
    end = number / RATE
    return RawFrame(number, led + 1, end, sensor.image(shares, middle(end), number))


def middle(end: float) -> float:
    return end - SCENE.exposure_s / 2


def replay_press(sensor: SimulatedSensor, work: Path, calibration: Path) -> dict[int, Moment]:
    """The heights of the recording by the number of their newest frame."""
    variant = work / "pictures.yaml"
    variant.write_text(GRAPH)
    params = {
        "recording": work / "recording",
        "calibration": calibration,
        "speed": 0.0,
        "rrd": work / "live.rrd",
    }
    stream = {}
    first = len(sensor.lights) - 1
    with open_pipeline(str(variant), params) as pipeline:
        for number, result in enumerate(pipeline.items(), start=first):
            end = number / RATE
            stream[number] = Moment(
                end,
                result["height"],
                sensor.true_height(middle(end)),
                result["shadow"],
                result["image"],
                result["pixel"],
            )
    return stream


def draw_preview(moment: Moment, file: Path) -> None:
    top = round_up(float(moment.height.max()))
    footer = f"{moment.seconds:.2f} s after the film was touched"
    touch = Touch(moment.height, moment.image, moment.pixel, layers={"shadow": moment.shadow})
    picture = draw_touch(touch, top, footer)
    Image.fromarray(picture).save(file, optimize=True)


def draw_strip(stream: list[Moment], file: Path) -> None:
    """Heights above, their errors below, time to the right."""
    figure = Figure(figsize=(13, 2.75), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(stream))
    heights = Normalize(0, max(float(s.height.max()) for s in stream))
    errors = Normalize(-50, 50)
    for upper, lower, moment in zip(*axes, stream, strict=True):
        upper.imshow(moment.height, cmap="viridis", norm=heights)
        upper.set_title(f"{moment.seconds:.1f} s", fontsize=9)
        lower.imshow(1e3 * (moment.height - moment.truth), cmap="RdBu_r", norm=errors)
        rmse = 1e3 * float(np.sqrt(np.mean((moment.height - moment.truth) ** 2)))
        lower.set_title(f"RMSE {rmse:.1f} µm", fontsize=8)
        for ax in (upper, lower):
            ax.set_axis_off()
    figure.colorbar(ScalarMappable(heights, "viridis"), ax=axes[0], label="height / mm")
    bar = ScalarMappable(errors, "RdBu_r")
    figure.colorbar(bar, ax=axes[1], label="error / µm", extend="both")
    figure.savefig(file, dpi=110)


if __name__ == "__main__":
    main()
