"""Many captures on a local Dask cluster, with kills: what docs/scale.md says.

python benchmarks/scale.py --out scale                 # 2,000 captures, 320 x 240
python benchmarks/scale.py --out scale --captures 200  # a quick look
python benchmarks/scale.py --out truths --truths       # captures with their truth beside them
"""

import argparse
import json
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
import psutil
from rich.console import Console
from rich.table import Table

from tactograph.graph.batch.store import Store, open_store

ROOT = Path(__file__).resolve().parents[1]
SIZE = (240, 320)
DISTINCT = 20
"""Touches that are simulated; the others are these with noise of their own."""
RUN = [sys.executable, "-m", "tactograph.graph.command"]
DASK = "from distributed.cli.dask_{0} import main; main()"
CHEAP = """
format: 1
title: Next to nothing, to see what the scheduler costs
params: {capture: {kind: path}}
prefer: [numpy]
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  lit:    {op: label_lit, in: {light: frames.image}}
outputs: {lit: lit}
"""


def main() -> None:
    """Measure, print the table and write it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("scale"))
    parser.add_argument("--captures", type=int, default=2000)
    parser.add_argument("--many", type=int, default=20_000, help="for the scheduler's memory")
    parser.add_argument("--truths", action="store_true", help="put the truth beside each capture")
    parser.add_argument("--kill-every", type=float, default=20.0, help="seconds")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    make_captures(given.out, given.captures, truths=given.truths)
    found: dict[str, Any] = {"captures": given.captures}
    studies: dict[str, Callable[[], dict[str, Any]]] = {
        "one process": lambda: alone(given.out, "alone.zarr", "--workers", "1"),
        "--workers as by default": lambda: alone(given.out, "default.zarr"),
        "Dask, 1 worker": lambda: cluster(given.out, 1),
        "Dask, 2 workers": lambda: cluster(given.out, 2),
        "Dask, 2 workers, with kills": lambda: killed(given.out, given.kill_every),
        f"scheduler, {given.captures} captures": lambda: scheduler_cost(given.out, given.captures),
        f"scheduler, {given.many} captures": lambda: scheduler_cost(given.out, given.many),
    }
    for name, study in studies.items():
        found[name] = study()
        print(name, found[name], flush=True)
        (given.out / "scale.json").write_text(json.dumps(found, indent=1) + "\n")
    show(found)


def make_captures(out: Path, count: int, *, truths: bool) -> None:
    """Simulate a few touches, and make `count` captures of them by adding noise."""
    folder = out / "captures"
    if folder.is_dir() and len(list(folder.iterdir())) == count:
        return
    tactograph("run", "simulate_flat", f"out={out / 'flat'}", "seed=2", "--quiet")
    tactograph("run", "simulate", f"out={out / 'ball'}", "radius_mm=7", "seed=1", "--quiet")
    tactograph(
        "run", "calibrate", f"capture={out / 'ball'}", f"flat={out / 'flat'}", "ball_radius_mm=7",
        "pixel_size_mm=0.0714286", f"out={out / 'cal.npz'}", "--quiet",
    )  # fmt: skip
    rng = np.random.default_rng(1)
    touches = []
    for n in range(DISTINCT):
        place = out / "touches" / str(n)
        radius = f"radius_mm={rng.uniform(2.5, 5.5):.2f}"
        tactograph("run", "simulate_press", f"out={place}", radius, f"seed={n}", "--quiet")
        images = [cv2.imread(str(place / f"led{k}.png"), cv2.IMREAD_GRAYSCALE) for k in range(1, 5)]
        touches.append(np.stack([image for image in images if image is not None]))
    for n in range(count):
        place = folder / f"capture_{n:06}"
        place.mkdir(parents=True, exist_ok=True)
        noisy = touches[n % DISTINCT] + rng.integers(-1, 2, (4, *SIZE))
        for k, image in enumerate(np.clip(noisy, 0, 255).astype(np.uint8), start=1):
            cv2.imwrite(str(place / f"led{k}.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        for known in (out / "touches" / str(n % DISTINCT)).glob("truth_*") if truths else ():
            shutil.copy(known, place)


def alone(out: Path, name: str, *options: str) -> dict[str, Any]:
    """This machine without a cluster; one process is the reference."""
    start, before = time.perf_counter(), processor()
    tactograph(*batch(out, name), *options)
    found = timed(out, name, start)
    spent = 1e3 * (processor() - before) / len(opened(out, name))
    return {**found, "processor ms a capture": round(spent, 1), **compared(out, name)}


def cluster(out: Path, workers: int) -> dict[str, Any]:
    """The same on a cluster of `workers` processes, undisturbed."""
    name = f"dask{workers}.zarr"
    with Machines(workers) as machines:
        start = time.perf_counter()
        tactograph(*batch(out, name), "--scheduler", machines.address)
        return {**timed(out, name, start), **machines.cost(), **compared(out, name)}


def killed(out: Path, every: float) -> dict[str, Any]:
    """Workers killed at random, the scheduler restarted, the client killed and started again."""
    name = "killed.zarr"
    rng = random.Random(1)
    counts = {"workers killed": 0, "clients killed": 0, "schedulers restarted": 0}
    with Machines(2) as machines:
        start = time.perf_counter()
        while True:
            client = subprocess.Popen(
                [*RUN, *batch(out, name), "--scheduler", machines.address],
                cwd=ROOT, stdout=subprocess.DEVNULL,
            )  # fmt: skip
            ended = False
            while not ended:
                try:
                    client.wait(rng.uniform(0.5, 1.5) * every)
                    ended = True
                except subprocess.TimeoutExpired:
                    what = rng.choice(["worker", "worker", "worker", "client", "scheduler"])
                    if what == "worker":
                        machines.kill_worker(rng.randrange(2))
                        counts["workers killed"] += 1
                    elif what == "scheduler":
                        machines.restart_scheduler()
                        counts["schedulers restarted"] += 1
                    else:
                        client.send_signal(signal.SIGKILL)
                        client.wait()
                        counts["clients killed"] += 1
                        ended = True
            if client.returncode == 0:
                return {**timed(out, name, start), **counts, **compared(out, name)}


def scheduler_cost(out: Path, count: int) -> dict[str, Any]:
    """What the scheduler holds and does for `count` captures that cost next to nothing."""
    graph = out / "cheap.yaml"
    graph.write_text(CHEAP)
    links = out / f"links{count}"
    real = sorted((out / "captures").iterdir())
    for n in range(count):
        link = links / f"capture_{n:06}"
        if not link.exists():
            links.mkdir(exist_ok=True)
            link.symlink_to(real[n % len(real)].resolve(), target_is_directory=True)
    with Machines(2) as machines:
        start = time.perf_counter()
        with machines.watched() as most:
            tactograph(
                "batch", str(graph), "--over", f"{links}/*",
                "--out", str(out / f"cheap{count}.zarr"),
                "--scheduler", machines.address,
            )  # fmt: skip
        cost = machines.cost()
        spent = time.perf_counter() - start
    return {
        "seconds": round(spent, 1),
        "captures/s": round(count / spent, 1),
        "scheduler MiB at start": round(most[0] / 2**20, 1),
        "scheduler MiB at most": round(max(most) / 2**20, 1),
        **cost,
    }


class Machines:
    """A scheduler and workers of one thread, each a process of its own."""

    def __init__(self, workers: int) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = str(free.getsockname()[1])
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = self._scheduler()
        self.workers = [self._worker() for _ in range(workers)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def kill_worker(self, number: int) -> None:
        self.workers[number].kill()
        self.workers[number].wait()
        self.workers[number] = self._worker()

    def restart_scheduler(self) -> None:
        """Workers leave with their scheduler; whoever runs them starts them again."""
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self._scheduler()
        for number in range(len(self.workers)):
            self.kill_worker(number)

    @contextmanager
    def watched(self) -> Iterator[list[int]]:
        """Collect the scheduler's resident memory, four times a second."""
        process, most, stop = psutil.Process(self.scheduler.pid), [], threading.Event()

        def watch() -> None:
            while not stop.wait(0.25):
                most.append(process.memory_info().rss)

        thread = threading.Thread(target=watch)
        thread.start()
        try:
            yield most
        finally:
            stop.set()
            thread.join()

    def cost(self) -> dict[str, float]:
        """How many state changes of tasks the scheduler has seen."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            changes = client.run_on_scheduler(
                lambda dask_scheduler: dask_scheduler.transition_counter
            )
        return {"task state changes": changes}

    def _scheduler(self) -> subprocess.Popen[bytes]:
        return self._start(
            "scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard"
        )

    def _worker(self) -> subprocess.Popen[bytes]:
        words = ("--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard")
        return self._start("worker", self.address, *words)

    def _start(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-c", DASK.format(what), *words],
            cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip


def batch(out: Path, name: str) -> list[str]:
    return [
        "batch", "reconstruct", f"calibration={(out / 'cal.npz').resolve()}",
        "--over", f"{(out / 'captures').resolve()}/*", "--out", str((out / name).resolve()),
    ]  # fmt: skip


def processor() -> float:
    """Seconds of the processor that all ended children have taken, theirs included."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(out: Path, name: str, start: float) -> dict[str, Any]:
    store, spent = opened(out, name), time.perf_counter() - start
    size = sum(f.stat().st_size for f in (out / name).rglob("*") if f.is_file())
    return {
        "seconds": round(spent, 1),
        "captures/s": round(len(store) / spent, 2),
        "MB in the store": round(size / 1e6, 1),
        "ms in the worker, median": round(float(np.median(milliseconds(store))), 1),
    }


def milliseconds(store: Store) -> list[float]:
    return [entry.milliseconds for entry in store.read_all()]


def compared(out: Path, name: str) -> dict[str, Any]:
    """Every capture is done, once, and equals the single process's to the bit."""
    mine, reference = opened(out, name), opened(out, "alone.zarr")
    assert mine.captures == reference.captures
    assert len(set(mine.captures)) == len(mine)
    same = all(
        np.array_equal(mine.map(each, n), reference.map(each, n))
        for n in range(len(mine))
        for each in mine.job.maps
    )
    return {"done": int((mine.statuses == 1).sum()), "equal to the bit": same}


def opened(out: Path, name: str) -> Store:
    store = open_store(str(out / name))
    assert store is not None
    return store


def tactograph(*words: str) -> None:
    subprocess.run([*RUN, *words], check=True, stdout=subprocess.DEVNULL)


def show(found: dict[str, Any]) -> None:
    table = Table("what", "measured")
    for name, values in found.items():
        if isinstance(values, dict):
            table.add_row(name, ", ".join(f"{k} {v}" for k, v in values.items()))
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
