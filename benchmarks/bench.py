"""Every shipped graph on every back end and device, against the literal flow in the same run.

    python benchmarks/bench.py --out bench
    python benchmarks/bench.py --graphs paper,reconstruct --sizes 640x480 --tables 117000
    python benchmarks/bench.py --films all --sizes 320x240,640x480 --tables 0 --devices Portable \
        --graphs paper,reconstruct,precise,precise:height+error+shadow+confidence
    python benchmarks/bench.py --films soft,hand --graphs see_touch --sizes 640x480 --tables 0

Times are from host images in memory to host height in memory, or to the outputs that stand after a
graph's name; of a stream, how many a second.  Captures are simulated; tables
are drawn from the calibration's own entries, or extended by jittered copies (0: as they are).
Time hangs on film, noise and table, and on how many pixels need LEDs left out: there are several
films, and each row has the share of pixels in shadow.  Each case runs in its own process, in
which the literal flow and the graph alternate, so that ratios hold on a busy machine.  A case
that takes longer than --seconds is aborted.  Cases measured earlier with the same --out stay in
the table unless they are measured again, so the whole can be done in parts.  `see_touch` goes from
the capture's true height to images, which the literal flow does not.
"""

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import click
import cv2
import numpy as np
from literal import Literal
from precise import HARD, calibrated, enlarged, prepare

from tactograph.graph import load
from tactograph.graph.backends.devices import find_devices
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.run.open_pipeline import open_pipeline

SIZES = "320x240,640x480,1640x1232,4928x3264"
TABLES = "2000,20000,117000"
VGA = 640 * 480
"""Larger images are not given to the literal flow, and are measured in fewer rounds."""
MOST_RENDERED = 1640 * 1232
WIDTH_MM = 640 / 28
EVEN_NOISE = {"camera.shot_noise": False}


class Film(NamedTuple):
    """How a capture and its calibration are made.

    Attributes
    ----------
    graph
        What simulates it.
    changes
        Settings of that graph's nodes.
    has_flat
        Whether it is calibrated with a flat frame.
    capture, press
        What is simulated: values of `graph`, for the capture and for the calibration's presses.
    places
        Where these are, in mm from the middle.
    pressed
        Settings of nodes for these alone.
    sensor
        More values of `calibrate`.
    """

    graph: str = "simulate"
    changes: Mapping[str, Any] = {}
    has_flat: bool = True
    capture: Mapping[str, float] = {"radius_mm": 5.0}
    press: Mapping[str, float] = {"radius_mm": 7.0}
    places: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    pressed: Mapping[str, Any] = {}
    sensor: Mapping[str, float] = {}


NEAR = "near_cat"
HAND = {"rise_mm": 2.0, "lens_at_corner": 0.0}
FILMS = {
    "noisy": Film(),
    "quiet": Film(changes=EVEN_NOISE),
    "no_flat": Film(changes={**EVEN_NOISE, "camera.read_noise": 41.0}, has_flat=False),
    "soft": Film("simulate_press"),
    "hand": Film(
        "simulate_hand",
        capture={"radius_mm": 5.0, **HAND},
        press={"radius_mm": 6.0, **HAND},
        places=((0.0, 0.0), (-2.5, 1.0)),
        pressed={"film.reach_mm": 0.0, "film.skin_mm": 0.0},
        sensor={"camera_mm": 65.0},
    ),
    NEAR: Film(),
}
"""Half balls that stand uncovered: with a camera's noise, a sixth of a grey level, and 0.7 without
a flat frame; a ball pressed into soft film; one pressed into a coated film that lights itself.  A
rigid cat under near LEDs, of 640 x 480, is that of `precise.py`."""


@click.command()
@click.option("--graphs", default=None, help="Comma-separated; else all that take a capture.")
@click.option("--sizes", default=SIZES)
@click.option("--tables", default=TABLES)
@click.option("--films", default="noisy", help=f"all, or some of {', '.join(FILMS)}.")
@click.option("--rounds", default=5, help="At 640 x 480; fewer on larger images, at least 1.")
@click.option("--seconds", default=300.0, help="Longest a case may take.")
@click.option("--devices", default=None, help="numpy, parts of devices' names; else all.")
@click.option("--out", default="bench", type=click.Path(path_type=Path, resolve_path=True))
@click.option("--one", default=None, hidden=True, help="A case, as JSON.")
def main(
    graphs: str | None,
    sizes: str,
    tables: str,
    films: str,
    rounds: int,
    seconds: float,
    devices: str | None,
    out: Path,
    one: str | None,
) -> None:
    if one is not None:
        print(json.dumps(measure(**json.loads(one))))
        return
    names = graphs.split(",") if graphs else takers()
    out.mkdir(exist_ok=True)
    rows = former(out / "bench.json")
    for film, size in product(FILMS if films == "all" else films.split(","), sizes.split(",")):
        if film == NEAR and size != "640x480":
            continue
        stack = capture(out, film, size)
        for table in map(int, tables.split(",")):
            file = calibration(out, film, size, table)
            for name, place in product(names, places(devices)):
                case = {"graph": name, "device": place, "stack": stack, "file": file}
                row = in_own_process({**case, "rounds": rounds}, seconds)
                row = {"film": film, "size": size, "table": table, **case, **row}
                rows[film, size, table, name, place] = row
                print(as_line(row), flush=True)
                (out / "bench.json").write_text(json.dumps(list(rows.values()), indent=1))


def places(devices: str | None) -> list[str]:
    """The host's back ends, and the names of the devices that work."""
    every = ["numpy", *(d.name for d in find_devices() if d.works and not d.simulator)]
    parts = devices.split(",") if devices else [""]
    return [name for name in every if any(part in name for part in parts)]


def former(file: Path) -> dict[tuple[str, str, int, str, str], dict[str, Any]]:
    """The rows of an earlier run, by case."""
    rows = json.loads(file.read_text()) if file.is_file() else []
    return {(r["film"], r["size"], r["table"], r["graph"], r["device"]): r for r in rows}


def takers() -> list[str]:
    """The pipelines that ship and want nothing but a capture and a calibration."""
    needed = {"capture", "calibration"}
    params = {name: read_graph(name).params for name in shipped_names()}
    return [n for n, p in params.items() if {k for k, v in p.items() if v.required} == needed]


def simulated(
    folder: Path,
    film: str,
    size: str,
    seed: int,
    params: Mapping[str, float] | None = None,
    changes: Mapping[str, Any] = {},
) -> Path:
    """A capture of WIDTH_MM, rendered once; of the film at rest if nothing is `given`."""
    if folder.is_dir():
        return folder
    width, height = map(int, size.split("x"))
    side = {"width_px": width, "height_px": height, "pixel_size_mm": WIDTH_MM / width}
    base = FILMS[film].graph if params else FILMS[film].graph.removesuffix("_press") + "_flat"
    graph = with_changes(read_graph(base), {**FILMS[film].changes, **changes})
    words = {"out": folder, "seed": seed, **side, **(params or {})}
    for _ in open_pipeline(graph, words).items():
        pass
    return folder


def capture(out: Path, film: str, size: str) -> str:
    """A capture of a film, as an array file; large ones enlarged, noise drawn anew."""
    width, height = map(int, size.split("x"))
    if film == NEAR:
        prepare(HARD, out)
        return str(out / "frames.npy")
    rendered = size if width * height <= MOST_RENDERED else "640x480"
    folder = simulated(out / f"{film}_{rendered}", film, rendered, 3, FILMS[film].capture)
    images = [cv2.imread(str(f), cv2.IMREAD_UNCHANGED) for f in sorted(folder.glob("led*.png"))]
    if rendered != size:
        rng = np.random.default_rng(5)
        images = [enlarged(image, (width, height), rng) for image in images]
    np.save(out / f"{film}_{size}.npy", np.stack(images))
    return str(out / f"{film}_{size}.npy")


def calibration(out: Path, film: str, size: str, entries: int) -> str:
    """The calibration of 640 x 480 with another table, its flat image brought to `size`."""
    first, kind = out / f"cal_{film}.npz", FILMS[film]
    if film == NEAR:
        return str(calibrated(HARD, out))
    if not first.is_file():
        presses = out / f"{film}_presses"
        for number, place in enumerate(kind.places, start=1):
            changes = {"shape.offset_mm": list(place), **kind.pressed}
            simulated(presses / str(number), film, "640x480", 10 * number, kind.press, changes)
        params: dict[str, Any] = {
            "capture": presses,
            "ball_radius_mm": kind.press["radius_mm"],
            "pixel_size_mm": WIDTH_MM / 640,
            "out": first,
            **kind.sensor,
        }
        if kind.has_flat:
            params["flat"] = str(simulated(out / f"{film}_flat", film, "640x480", 2))
        start = time.process_time()
        for _ in open_pipeline("calibrate", params).items():
            pass
        spent = time.process_time() - start
        print(f"{film:>8} calibrate: {spent:.1f} s of the processor", flush=True)
    with np.load(first, allow_pickle=False) as found:
        cal = dict(found)
    rng = np.random.default_rng(0)
    have = len(cal["lut_light"])
    entries = entries or have
    chosen = np.concatenate([rng.permutation(have), rng.integers(0, have, max(0, entries - have))])
    for name in ("lut_light", "lut_slope", "lut_lit"):
        cal[name] = cal[name][chosen[:entries]]
    cal["lut_light"][have:] += rng.normal(0, 0.002, cal["lut_light"][have:].shape)
    width, height = map(int, size.split("x"))
    cal["pixel_size"] = np.float32(WIDTH_MM / width)
    cal["flat"] = np.stack([cv2.resize(plane, (width, height)) for plane in cal["flat"]])
    cal["area"] = np.ones((height, width), np.uint8)
    for name in ("dark", "rest"):
        cal[name] = cv2.resize(cal[name], (width, height))
    file = out / f"cal_{film}_{size}_{entries}.npz"
    np.savez(file, **cal)
    return str(file)


def in_own_process(case: dict[str, Any], seconds: float) -> dict[str, Any]:
    words = [sys.executable, __file__, "--one", json.dumps(case)]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return {"error": f"given up after {seconds:g} s"}
    if done.returncode:
        return {"error": done.stderr.strip().splitlines()[-1]}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measure(graph: str, device: str, stack: str, file: str, rounds: int) -> dict[str, Any]:
    """Milliseconds of one case: on the wall, and of the processor by the cores there are."""
    images = np.load(stack)
    graph, _, more = graph.partition(":")
    start = time.perf_counter()
    where = {"backend": device} if device == "numpy" else {"device": device}
    forwards = graph == "see_touch"
    outputs = more.split("+") if more else ["image" if forwards else "height"]
    pipeline = load(graph, calibration=file, outputs=outputs, **where)
    arguments = {"frames": images}
    if forwards:
        arguments = {"height": np.load(Path(stack).with_suffix("") / "truth_height_mm.npy")}
    result = pipeline(**arguments)
    first = 1e3 * (time.perf_counter() - start)
    allocated = pipeline.buffers
    pipeline(**arguments)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    literal = None
    if images[0].size <= VGA and not forwards:
        scaled = images / np.float64(np.iinfo(images.dtype).max)
        flow = Literal(file)
        literal = lambda: flow(scaled)  # noqa: E731
    ours, theirs, nodes = [], [], []
    for _ in range(max(1, min(rounds, rounds * VGA // images[0].size))):
        if literal is not None:
            theirs.append(timed(literal))
            settle(lambda: pipeline(**arguments))
        for _ in range(5 if literal or forwards else 1):
            ours.append(timed(lambda: nodes.append(pipeline(**arguments).times)))
    many = 2 + int(1e3 / median(wall for wall, _ in ours))
    stream, _ = timed(lambda: list(pipeline.stream(arguments for _ in range(many))))
    row: dict[str, Any] = {
        "per_second": 1e3 * many / stream,
        "first_ms": first,
        "peak_mib": peak,
        "buffers": [allocated, pipeline.buffers],
        "ms": median(wall for wall, _ in ours),
        "cpu_ms": median(cpu for _, cpu in ours),
        "nodes": {name: median(times[name] for times in nodes) for name in result.times},
        "once": [step.name for step in pipeline.plan.steps if not step.stream],
    }
    if "shadow" in read_graph(graph).outputs:
        labels = load(graph, calibration=file, outputs=["shadow"], **where)(frames=images)["shadow"]
        row["shadow_percent"] = 100 * float((labels > 0).mean())
    if theirs:
        row["literal_ms"] = median(wall for wall, _ in theirs)
        row["literal_cpu_ms"] = median(cpu for _, cpu in theirs)
        row["ratio"] = row["literal_ms"] / row["ms"]
        row["cpu_ratio"] = row["literal_cpu_ms"] / row["cpu_ms"]
    return row


def settle(call: Callable[[], object], seconds: float = 0.15) -> None:
    """Run until the other flow's threads have stopped spinning, and the caches are one's own."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        call()


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Milliseconds on the wall, and of processor time divided by the number of cores."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    cores = os.cpu_count() or 1
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu) / cores


def as_line(row: dict[str, Any]) -> str:
    case = f"{row['film']:>8} {row['size']:>9} {row['table']:>7}"
    head = f"{case} {row['graph']:<22} {row['device']:.24}"
    if "error" in row:
        return f"{head}: {row['error']}"
    ratio = f", {row['ratio']:.1f} x ({row['cpu_ratio']:.1f} x by CPU)" if "ratio" in row else ""
    return (
        f"{head}: {row['ms']:.1f} ms ({row['cpu_ms']:.1f} by CPU){ratio}, "
        f"{row['per_second']:.0f} /s, "
        f"{row.get('shadow_percent', 0):.0f} % in shadow, "
        f"first {row['first_ms']:.0f} ms, {row['peak_mib']:.0f} MiB"
    )


if __name__ == "__main__":
    main()
