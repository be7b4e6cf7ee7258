"""What the engine itself costs: per node and item, at start-up, and over a long stream.

    python benchmarks/overhead.py [PART OF A DEVICE'S NAME]

A chain of 20 trivial nodes (flat_field on 3 x 2 x 2 pixels) runs through the engine, and in turn
with it, item by item, what the nodes take without one: on the host 20 calls of the function, on
a device 20 launches of the kernel by a bare loop that then waits.  Given are the whole, and what
the engine adds.
"""

import gc
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from tactograph.graph import load
from tactograph.graph.backends.devices import Device, choose_device
from tactograph.graph.backends.launch import global_size, local_size
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.run.pipeline import Pipeline
from tactograph.nodes.light.flat_field import flat_field

NODES = 20
STACK = np.full((3, 4, 4), 0.5, np.float32)
DARK = np.zeros((4, 4), np.float32)
ITEMS = 10_000


def main() -> None:
    pipeline = chain(backend="numpy")
    compare("numpy", pipeline, bare_calls)
    grow("numpy", pipeline)
    device, reason = choose_device(sys.argv[1] if len(sys.argv) > 1 else None)
    if device is None:
        print(f"opencl: {reason}")
    else:
        pipeline = chain(backend="opencl", device=device.name)
        first, last = buffers(pipeline)
        compare(device.name, pipeline, bare_launches(device))
        grow("opencl", pipeline)
        print(f"opencl: {first} buffers allocated by the first item, {last} by {ITEMS} items")
    numpy = seconds([sys.executable, "-c", "import numpy"])
    for words in (["-m", "tactograph.graph.command", "--help"], ["-c", "import tactograph.graph"]):
        took = seconds([sys.executable, *words])
        print(f"{' '.join(words)}: {took:.3f} s, {took / numpy:.2f} x of importing numpy")


def compare(name: str, pipeline: Pipeline, bare: Callable[[], None]) -> None:
    """Print what a node takes, with the engine and without."""
    seconds = fastest(partial(pipeline, frames=STACK), bare)
    whole, own = (1e6 * each / NODES for each in seconds)
    print(
        f"{name}: {whole:.1f} us per node and item, "
        f"{own:.1f} of them without the engine, {whole - own:.1f} more with it"
    )


def grow(name: str, pipeline: Pipeline) -> None:
    """Print the memory that a long stream takes."""
    before, after = stream_growth(pipeline)
    print(f"{name}: {ITEMS} items: {before} KiB peak after 100, {after} KiB at the end")


def chain(**params: str) -> Pipeline:
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
        return load(str(file), **params)


def bare_calls() -> None:
    """What the chain does on the host."""
    for _ in range(NODES):
        flat_field(STACK, STACK, DARK)


def bare_launches(device: Device) -> Callable[[], None]:
    """What the chain does on a device, on a queue like the engine's."""
    opencl = OpenCL(device)
    kernel = opencl.compiled(flat_field).kernels_with({})[flat_field.name]
    image, flat, dark, light = (opencl.upload(a).buffer for a in (STACK, STACK, DARK, STACK))
    local = local_size(1)
    work_items = global_size((-(-DARK.size // opencl.lanes),), local)
    sizes = [np.int32(size) for size in STACK.shape]
    there = [image, flat, dark, None, light, *sizes, np.float32(0.02)]
    back = [light, flat, dark, None, image, *sizes, np.float32(0.02)]

    def launch() -> None:
        for arguments in [there, back] * (NODES // 2):
            kernel.bind(opencl.queue, work_items, local, arguments)()
        opencl.finish()

    return launch


def fastest(*calls: Callable[[], object]) -> list[float]:
    """Seconds of each call, taken in turns: the median of the fastest tenth of many."""
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(520):
        for call, own in zip(calls, times, strict=True):
            start = time.perf_counter()
            call()
            own.append(time.perf_counter() - start)
    return [median(sorted(own[20:])[:50]) for own in times]


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
