"""What the engine itself costs: per node and item, at start-up, and over a long stream.

    python benchmarks/overhead.py

A chain of 20 trivial nodes (flat_field on 3 x 2 x 2 pixels) runs through the engine; what the
nodes' own calls cost is measured beside it and taken off.
"""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

from tactograph.graph import load
from tactograph.graph.run import Pipeline
from tactograph.nodes.flat_field import flat_field

NODES = 20
STACK = np.full((3, 2, 2), 0.5, np.float32)
ITEMS = 10_000


def main() -> None:
    for backend in ("numpy", "opencl"):
        pipeline = chain(backend)
        per_node = engine_microseconds(pipeline, backend)
        print(f"{backend}: {per_node:.1f} us per node and item, the node's own call taken off")
        before, after = stream_growth(pipeline)
        print(f"{backend}: {ITEMS} items: {before} KiB peak after 100, {after} KiB at the end")
        if backend == "opencl":
            first, last = buffers(chain(backend))
            print(f"opencl: {first} buffers allocated by the first item, {last} by {ITEMS} items")
    bare = seconds([sys.executable, "-c", "import numpy"])
    for words in (["-m", "tactograph.graph.command", "--help"], ["-c", "import tactograph.graph"]):
        took = seconds([sys.executable, *words])
        print(f"{' '.join(words)}: {took:.3f} s, {took / bare:.2f} x of importing numpy")


def chain(backend: str) -> Pipeline:
    """A pipeline of NODES divisions by one."""
    lines = [
        "format: 1",
        "params: {capture: {kind: path}}",
        "nodes:",
        "  frames: {op: read_capture, with: {folder: $capture}}",
        "  rest: {op: read_flat, in: {image: frames.image}}",
    ]
    image = "frames.image"
    for number in range(NODES):
        inputs = f"{{image: {image}, flat: rest.flat, dark: rest.dark}}"
        lines.append(f"  n{number}: {{op: flat_field, in: {inputs}}}")
        image = f"n{number}"
    lines.append(f"outputs: {{light: {image}}}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "chain.yaml"
        file.write_text("\n".join(lines))
        return load(str(file), backend=backend)


def engine_microseconds(pipeline: Pipeline, backend: str) -> float:
    """Per node and item; on the host less what the bare function takes."""
    whole = fastest(lambda: pipeline(frames=STACK))
    dark = np.zeros((2, 2), np.float32)
    own = fastest(lambda: flat_field(STACK, STACK, dark)) * NODES if backend == "numpy" else 0.0
    return 1e6 * (whole - own) / NODES


def fastest(call: Callable[[], object]) -> float:
    """Seconds of one call: the median of the fastest tenth of many."""
    for _ in range(20):
        call()
    times = []
    for _ in range(500):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return median(sorted(times)[:50])


def stream_growth(pipeline: Pipeline) -> tuple[int, int]:
    """Peak memory in KiB after 100 items and after ITEMS."""
    for _ in range(100):
        pipeline(frames=STACK)
    gc.collect()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(ITEMS):
        pipeline(frames=STACK)
    return before, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def buffers(pipeline: Pipeline) -> tuple[int, int]:
    """Device buffers that exist after the first item and after ITEMS; the pool frees none."""
    counts = []
    for items in (1, ITEMS - 1):
        for _ in range(items):
            pipeline(frames=STACK)
        counts.append(pipeline.buffers)
    return counts[0], counts[1]


def seconds(words: list[str]) -> float:
    """CPU seconds of a process, the least of several."""
    times = []
    for _ in range(7):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


if __name__ == "__main__":
    main()
