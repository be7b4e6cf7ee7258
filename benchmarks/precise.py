"""How long `precise` takes at 640 x 480, by node, and against another version of the package.

    python benchmarks/precise.py
    python benchmarks/precise.py --before "../before/.venv/bin/python" --rounds 7
    python benchmarks/precise.py --outputs height --backend numpy
    python benchmarks/precise.py --graph precise_stream --moves 3     # a touch that moves
    python benchmarks/precise.py --capture balls_2 --calibration six.npz --graph reconstruct

The captures are an easy one (a ball pressed into a soft film) and a hard one (a rigid cat under
near LEDs) from tests/data, with twice as many pixels per side and new noise.  Times are from
images in memory to maps in memory.  With `--before`, a command that starts the Python of another
version, both versions alternate, each in its own process, so that ratios hold on a busy machine.
Processor time counts all threads.  Memory is the process's peak, including libraries and the
compiler of kernels.
"""

import json
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import click
import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "data"
EASY, HARD = "far28/sphere_film", "near33/cat"
MOST_ROWS = 12


class Spent(NamedTuple):
    """Milliseconds of an item: on the wall, of the processor, and by node; MiB held at most."""

    wall: float
    processor: float
    nodes: dict[str, float]
    memory: float


@click.command()
@click.option("--rounds", default=5)
@click.option("--outputs", default="height,error,shadow,confidence", show_default=True)
@click.option("--backend", type=click.Choice(["numpy", "opencl"]), default=None)
@click.option("--graph", default="precise", show_default=True)
@click.option("--before", default=None, help="A command that starts another version's Python.")
@click.option("--moves", default=0, help="By so many pixels the touch moves from item to item.")
@click.option("--capture", default=None, help="A capture of your own instead, with --calibration.")
@click.option("--calibration", default=None, help="A calibration file.")
@click.option("--leds", default=None, help="The LEDs of the capture that count: 1,2,3,4,5,6")
@click.option("--serve", default=None, hidden=True)
@click.option("--frames", default="", hidden=True)
def main(
    rounds: int,
    outputs: str,
    backend: str | None,
    graph: str,
    before: str | None,
    moves: int,
    capture: str | None,
    calibration: str | None,
    leds: str | None,
    serve: str | None,
    frames: str,
) -> None:
    if serve is not None:
        answer(serve, Path(frames), graph, outputs.split(","), backend, moves)
        return
    more = ["--outputs", outputs, "--graph", graph, *(["--backend", backend] if backend else [])]
    more += ["--moves", str(moves)] if moves else []
    if capture is not None:
        if calibration is None:
            raise click.UsageError("--capture needs --calibration")
        with tempfile.TemporaryDirectory() as folder:
            files = sorted(Path(capture).glob("led*.png"))
            chosen = [files[int(led) - 1] for led in leds.split(",")] if leds else files
            images = [cv2.imread(str(f), cv2.IMREAD_UNCHANGED) for f in chosen]
            np.save(Path(folder) / "frames.npy", np.stack(images))
            report(str(Path(calibration).resolve()), Path(folder), more, rounds, before)
        return
    for name in (EASY, HARD):
        with tempfile.TemporaryDirectory() as folder:
            prepare(name, Path(folder))
            report(name, Path(folder), more, rounds, before)


def report(name: str, folder: Path, more: list[str], rounds: int, before: str | None) -> None:
    """Print the medians of a capture."""
    ours = Server([sys.executable], name, folder, more)
    theirs = Server(shlex.split(before), name, folder, more) if before else None
    spent: list[Spent] = []
    earlier: list[Spent] = []
    for _ in range(rounds):
        spent.append(ours.item())
        if theirs is not None:
            earlier.append(theirs.item())
    for each in (ours, theirs):
        if each is not None:
            each.end()
    wall, processor = median(s.wall for s in spent), median(s.processor for s in spent)
    print(
        f"{name}: {wall:.1f} ms on the wall, {processor:.1f} ms of the processor, "
        f"{spent[-1].memory:.0f} MiB at most"
    )
    if earlier:
        then = median(s.wall for s in earlier), median(s.processor for s in earlier)
        print(
            f"  before: {then[0]:.0f} and {then[1]:.0f} ms; now 1/{then[0] / wall:.1f} of it on "
            f"the wall, 1/{then[1] / processor:.1f} by processor"
        )
    nodes = {n: median(s.nodes[n] for s in spent) for n in spent[0].nodes}
    longest = sorted(nodes.items(), key=lambda pair: -pair[1])[:MOST_ROWS]
    print("  " + ", ".join(f"{node} {ms:.1f}" for node, ms in longest), flush=True)


def prepare(name: str, folder: Path) -> None:
    """Write a capture at twice its size."""
    rng = np.random.default_rng(5)
    files = sorted((DATA / name).glob("led*.png"))
    images = [enlarged(cv2.imread(str(f), -1), (640, 480), rng) for f in files]
    np.save(folder / "frames.npy", np.stack(images))


def calibrated(name: str, folder: Path) -> Path:
    """Calibrate a capture's rig by this version's own command, for images of twice the size."""
    rig, first, file = DATA / name.partition("/")[0], folder / "small.npz", folder / "cal.npz"
    params = {"capture": rig / "calibration", "flat": rig / "flat", "out": first}
    words = [f"{key}={value}" for key, value in params.items()]
    words += ["ball_radius_mm=7", f"pixel_size_mm={1 / 14}", "--quiet"]
    command = [sys.executable, "-m", "tactograph.graph.command", "run", "calibrate", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder)
    with np.load(first, allow_pickle=False) as found:
        known = dict(found)
    known["pixel_size"] = np.float32(known["pixel_size"] / 2)
    known["flat"] = np.stack([cv2.resize(plane, None, fx=2, fy=2) for plane in known["flat"]])
    for name in ("dark", "rest"):
        known[name] = cv2.resize(known[name], None, fx=2, fy=2)
    known["area"] = cv2.resize(known["area"], None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    np.savez(file, **known)
    return file


def enlarged(image: Any, size: tuple[int, int], rng: np.random.Generator) -> Any:
    """An image with more pixels along both axes, and as much noise in each."""
    level = np.diff(image[:40].astype(np.float32), axis=1).std() / np.sqrt(2)
    smooth = cv2.GaussianBlur(image, (0, 0), size[0] / image.shape[1] / 2)
    smooth = cv2.resize(smooth, size).astype(np.float32)
    noisy = smooth + level * rng.standard_normal(smooth.shape, np.float32)
    return np.clip(np.round(noisy), 0, np.iinfo(image.dtype).max).astype(image.dtype)


class Server:
    """A process that keeps a graph open, and computes an item whenever it is asked."""

    def __init__(self, python: list[str], name: str, folder: Path, more: list[str]) -> None:
        frames = str(folder / "frames.npy")
        words = [*python, __file__, "--serve", name, "--frames", frames, *more]
        self._process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.item()

    def item(self) -> Spent:
        """Compute one; return what it took."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print("item", file=self._process.stdin, flush=True)
        return Spent(*json.loads(self._process.stdout.readline()))

    def end(self) -> None:
        """Let the process end."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def answer(
    name: str, file: Path, graph: str, outputs: list[str], backend: str | None, moves: int
) -> None:
    """What the process of a `Server` does."""
    from tactograph.graph import load

    with tempfile.TemporaryDirectory() as folder:
        calibration = Path(name) if Path(name).is_file() else calibrated(name, Path(folder))
        pipeline = load(graph, calibration=str(calibration), outputs=outputs, backend=backend)
        frames = np.load(file)
        with np.load(calibration, allow_pickle=False) as known:
            flat = known["flat"]
        pipeline(frames=frames)
    for number, _ in enumerate(sys.stdin, start=1):
        image = moved(frames, flat, moves * number)
        wall, processor = time.perf_counter(), time.process_time()
        times = pipeline(frames=image).times
        spent = time.perf_counter() - wall, time.process_time() - processor
        streams = {step.name for step in pipeline.plan.steps if step.stream}
        nodes = {name: ms for name, ms in times.items() if name in streams}
        held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(json.dumps([1e3 * spent[0], 1e3 * spent[1], nodes, held]), flush=True)


def moved(frames: Any, flat: Any, by: int) -> Any:
    """Images of the same touch `by` pixels to the right: the flat frame stays where it is."""
    if by == 0:
        return frames
    light = np.roll(frames / np.maximum(flat, 1e-3), by, axis=-1)
    return np.clip(np.round(light * flat), 0, np.iinfo(frames.dtype).max).astype(frames.dtype)


if __name__ == "__main__":
    main()
