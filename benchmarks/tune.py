"""How fast `tactograph tune` follows a slider, and what memory it takes after many updates.

    python benchmarks/tune.py
    python benchmarks/tune.py --graph precise --updates 100
    python benchmarks/tune.py --browser 20         in chromium, for so many seconds

A simulated touch of 640 x 480 pixels, the height looked at.  A parameter is changed as soon as
the height of the last change is there: one of the last nodes, then one of the first.  With
--browser chromium drags the slider instead, and the pictures that it shows are counted.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import numpy as np

from tactograph.graph.declare.find_node import find_node
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.rings.tune.controls import control_of
from tactograph.rings.tune.tuning import Tuning

SLIDERS = {
    "reconstruct": (("label", "price", 6.0), ("rough.1.label", "price", 6.0)),
    "precise": (("passes.3.system", "robust", 3.0), ("rough.1.label", "price", 6.0)),
}
SIZE = {"width_px": 640, "height_px": 480, "pixel_size_mm": 0.0357}


COUNT = """
window.pictures = 0;
(() => {
    let last = "";
    const count = () => {
        const picture = document.querySelector('[data-testid=picture] img');
        if (picture.complete && picture.src !== last) window.pictures++;
        last = picture.src;
        requestAnimationFrame(count);
    };
    count();
})()
"""
"""Counts the frames that show another picture than the frame before."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--graph", choices=list(SLIDERS), default="reconstruct")
    parser.add_argument("--updates", type=int, default=1000)
    parser.add_argument("--browser", type=float, metavar="SECONDS")
    arguments = parser.parse_args()
    print(f"{_machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        params = prepared(Path(folder))
        if arguments.browser:
            in_browser(arguments.graph, params, Path(folder), arguments.browser)
        else:
            follow(arguments.graph, params, arguments.updates)


def prepared(folder: Path) -> dict[str, str]:
    """A capture and a calibration of a simulated sensor."""
    touch, ball, flat, file = (folder / name for name in ("touch", "ball", "flat", "cal.npz"))
    for graph, params in (
        ("simulate", {**SIZE, "out": touch, "radius_mm": 5.0, "seed": 3}),
        ("simulate", {**SIZE, "out": ball, "radius_mm": 7.0, "seed": 1}),
        ("simulate_flat", {**SIZE, "out": flat, "seed": 2}),
        (
            "calibrate",
            {
                "capture": ball,
                "flat": flat,
                "ball_radius_mm": 7.0,
                "pixel_size_mm": SIZE["pixel_size_mm"],
                "out": file,
            },
        ),
    ):
        for _ in open_pipeline(graph, params).items():
            pass
    return {"capture": str(touch), "calibration": str(file)}


def _settle(tuning: Tuning) -> None:
    """Wait for the result of the latest request."""
    while tuning.state.request is not tuning.request:
        time.sleep(0.01)


def follow(graph: str, params: dict[str, str], updates: int) -> None:
    """Print how long the height takes to follow each parameter, and the memory meanwhile."""
    tuning = Tuning(graph, params)
    try:
        _settle(tuning)
        tuning.output = "height"
        for node, parameter, middle in SLIDERS[graph]:
            walls, processor = [], time.process_time()
            sizes = []
            for number, value in enumerate(_values(middle, updates)):
                before, start = tuning.state.number, time.perf_counter()
                tuning.set(node, parameter, value)
                while tuning.state.number == before:
                    time.sleep(0.0005)
                walls.append(time.perf_counter() - start)
                if number in (updates // 10, updates - 1):
                    sizes.append(_resident_mb())
            each = 1e3 * (time.process_time() - processor) / updates
            _settle(tuning)
            print(
                f"{graph} {node}.{parameter}: {1 / median(walls):.1f} updates/s "
                f"({1e3 * median(walls):.0f} ms, 95 % within "
                f"{1e3 * sorted(walls)[int(0.95 * updates)]:.0f} ms), "
                f"{each:.0f} ms of the processor each; "
                f"{sizes[0]:.0f} MB after {updates // 10} updates, {sizes[-1]:.0f} after {updates}"
            )
            if tuning.state.error:
                sys.exit(tuning.state.error)
    finally:
        tuning.close()


def in_browser(graph: str, params: dict[str, str], folder: Path, seconds: float) -> None:
    """Print how many pictures a second chromium shows while it drags a slider."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from rings.tune.tests.browser import Browser

    words = [f"{name}={value}" for name, value in params.items()]
    server = subprocess.Popen(
        [sys.executable, "-m", "tactograph.graph.command", "tune", graph, *words, "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    address = server.stdout.readline().strip()
    browser = Browser(folder / "profile")
    node, parameter, middle = SLIDERS[graph][0]
    try:
        time.sleep(5)
        browser.open(address)
        browser.wait("document.querySelector('[data-testid=picture] img')?.naturalWidth > 100", 90)
        browser.click(f'[data-node="{node}"] rect')
        browser.wait(f"document.querySelector('[data-testid=param-{parameter}]') !== null")
        browser.look(COUNT)
        # Around the middle every value gives another height; further up none does.
        ends = (_part(graph, node, parameter, factor * middle) for factor in (0.2, 1.8))
        there = np.linspace(*ends, 100).tolist()
        processes = (server.pid, browser.pid)
        start, before = time.perf_counter(), [_processor_ms(each) for each in processes]
        while time.perf_counter() - start < seconds:
            browser.drag(f"[data-testid=param-{parameter}]", [*there, *there[::-1]])
        pictures, wall = browser.look("window.pictures"), time.perf_counter() - start
        spent = [_processor_ms(each) - ms for each, ms in zip(processes, before, strict=True)]
        print(
            f"{graph} {node}.{parameter}: {pictures / wall:.1f} pictures/s in chromium; "
            f"{spent[0] / pictures:.0f} ms of the processor each, and {spent[1] / pictures:.0f} "
            "in the browser"
        )
    finally:
        browser.close()
        server.terminate()
        server.wait(timeout=30)


def _part(graph: str, node: str, parameter: str, value: float) -> float:
    """Where a value lies on its slider, 0 to 1."""
    entry = read_graph(graph).nodes[node]
    declared = find_node(entry.op).parameters[parameter]
    now = entry.settings.get(parameter, declared.default)
    return control_of(declared.annotation, declared.default, now).place(value) / 1000


def _processor_ms(process: int) -> float:
    """Processor time of a process and of those that it has started."""
    folder = Path(f"/proc/{process}")
    fields = (folder / "stat").read_text().rpartition(")")[2].split()
    own = 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    started = [each for task in (folder / "task").iterdir() for each in _started(task)]
    return own + sum(map(_processor_ms, started))


def _started(task: Path) -> list[int]:
    return [int(each) for each in (task / "children").read_text().split()]


def _values(middle: float, count: int) -> Iterator[float]:
    """Values around the middle, each of them new."""
    for number in range(count):
        yield middle * (0.8 + 0.4 * ((number * 0.618034) % 1))


def _resident_mb() -> float:
    status = Path("/proc/self/status").read_text()
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found is not None
    return int(found[1]) / 1024


def _machine() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


if __name__ == "__main__":
    main()
