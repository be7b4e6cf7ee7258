"""Corrupt inputs, and check that every command ends in one clear line.

    python benchmarks/fuzz.py --minutes 10 --seed 1

Hypothesis, with the seed, corrupts graph files, captures, calibrations, recordings and parameters:
bytes are changed, cut off or repeated, numbers made absurd, files of a folder swapped.  Each is
given to the command line in its own process.  It must end within a minute and 2 GB with exit code
0, or with exit code 2 and one line that begins with "tactograph: ".  Violations are printed with
the files that caused them, and the exit code is 1.
"""

import argparse
import io
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings, strategies as st
from PIL import Image

from tactograph.graph import Provenance, Session
from tactograph.graph.command import main as tactograph
from tactograph.graph.files.graph_places import (
    shipped,
)
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.recording.nodes.record import record

SIZE = {"width_px": 96, "height_px": 72, "pixel_size_mm": 0.25}
LONGEST_S = 60.0
MOST_BYTES = 2 * 2**30
ROUND = 10
"""Examples of a kind between two looks at the clock."""
NOBODY = Provenance({}, None, [], {}, {}, [], [])
SHIPPED = [*shipped("graphs").values(), *shipped("studies").values(), *shipped("overlays").values()]
RUNNABLE = ("reconstruct", "paper", "paper_no_shadow")

NUMBERS = st.sampled_from(
    ["0", "-1", "1e-300", "1e300", "-1e30", "1e9", "1e-9", "65536", "2147483648", "null", "true",
     ""]
) | st.floats().map(repr) | st.integers(-(2**70), 2**70).map(str)  # fmt: skip
WORDS = st.sampled_from(
    ["null", "[]", "{}", "$capture", "$out", "previous.light", "frames.image", "*", "&a", "!!map",
     "\x1b]0;x\x07", "\u202e", "1e400", "0x", ".inf", ".nan", "- ", ": ", "\n", "  ", "light", "K"]
)  # fmt: skip
BYTES = st.binary(min_size=1, max_size=12)
# Hypothesis likes small numbers; turned like this they lie anywhere.
SHARE = st.integers(0, 2**16 - 1).map(lambda number: number * 40503 % 2**16 / 2**16)
TOKEN = re.compile(rb"[^\s,:{}]+")
MODES = ("1", "L", "P", "LA", "RGB", "RGBA", "CMYK", "I;16", "I", "F")
EDITS = st.lists(
    st.tuples(st.sampled_from(["flip", "cut", "insert", "drop", "repeat", "zero"]), SHARE, BYTES),
    min_size=1,
    max_size=4,
)


@dataclass
class Outcome:
    """How a command ended."""

    code: int
    said: str
    seconds: float
    bytes: int

    @property
    def fault(self) -> str:
        lines = [line for line in self.said.splitlines() if line.startswith("tactograph: ")]
        if self.seconds > LONGEST_S:
            return f"did not end within {LONGEST_S:g} s"
        if self.bytes > MOST_BYTES:
            return f"took {self.bytes / 2**30:.1f} GB"
        if "Traceback" in self.said or self.code not in (0, 2):
            return f"exit code {self.code}"
        if self.code == 2 and len(lines) != 1 and not self.said.startswith("Usage: "):
            return "not one line"
        return ""


@dataclass
class Fuzz:
    """The inputs that are spoilt, and what came of it."""

    good: Path
    work: Path
    keep: Path
    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def run(self, kind: str, words: list[str]) -> None:
        outcome = in_a_process(words)
        self.ends[f"{kind}: exit {outcome.code}"] += 1
        if not outcome.fault:
            return
        copy = self.keep / f"{kind}_{len(self.faults):03}"
        shutil.copytree(self.work, copy, dirs_exist_ok=True)
        last = outcome.said.strip().splitlines()[-1:] or [""]
        line = f"{kind}: {outcome.fault}: {' '.join(words)!r}: {last[0][:300]!r} (kept: {copy})"
        self.faults.append(line)
        print(line, flush=True)

    def fresh(self) -> Path:
        """A copy of the good inputs, to be spoilt."""
        shutil.rmtree(self.work, ignore_errors=True)
        shutil.copytree(self.good, self.work)
        return self.work


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("fuzz"), help="what failed, for a look")
    args = parser.parse_args()
    end = time.monotonic() + 60 * args.minutes
    with tempfile.TemporaryDirectory() as top:
        fuzz = Fuzz(Path(top) / "good", Path(top) / "work", args.keep)
        make_inputs(fuzz.good)
        number = 0
        while time.monotonic() < end:
            for kind in (graphs, captures, calibrations, recordings, parameters):
                _examples(kind(fuzz), args.seed + 1000 * number, end)
            number += 1
    for line, times in sorted(fuzz.ends.items()):
        print(f"{line:<28} {times:>6}")
    print(f"{sum(fuzz.ends.values())} commands, {len(fuzz.faults)} faults")
    return int(bool(fuzz.faults))


def _examples(test: Callable[[], None], number: int, end: float) -> None:
    if time.monotonic() < end:
        quiet = settings(
            max_examples=ROUND,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        seed(number)(quiet(test))()


def graphs(fuzz: Fuzz) -> Callable[[], None]:
    """Text of a graph, study or overlay that ships, with pieces taken out, doubled, or put in."""

    @given(
        st.sampled_from(SHIPPED),
        EDITS,
        st.lists(st.tuples(SHARE, WORDS | NUMBERS), max_size=2),
    )
    def test(
        shipped: Path, edits: list[tuple[str, float, bytes]], words: list[tuple[float, str]]
    ) -> None:
        content = shipped.read_bytes()
        for place, word in words:
            tokens = list(TOKEN.finditer(content))
            token = tokens[int(place * len(tokens))]
            new = word.encode("utf-8", "replace")
            content = content[: token.start()] + new + content[token.end() :]
        if not words:
            content = spoilt(content, edits)
        file = fuzz.fresh() / "graph.yaml"
        file.write_bytes(content)
        fuzz.run("graph", ["check", str(file)])

    return test


def captures(fuzz: Fuzz) -> Callable[[], None]:
    """A capture whose files are spoilt, swapped, or described wrongly."""

    @given(st.sampled_from(["led1.png", "led3.png", "truth_height_mm.npy", "truth_shadow.png"]),
           EDITS, st.sampled_from(["bytes", "yaml", "swap", "mode", "array"]), NUMBERS, WORDS,
           st.sampled_from(MODES))  # fmt: skip
    def test(
        name: str,
        edits: list[tuple[str, float, bytes]],
        how: str,
        number: str,
        word: str,
        mode: str,
    ) -> None:
        folder = fuzz.fresh() / "ball"
        if how == "bytes":
            (folder / name).write_bytes(spoilt((folder / name).read_bytes(), edits))
        elif how == "yaml":
            text = f"bits: {number}\nleds: [1, 2, {number}]\nlights: {word}\n"
            (folder / "capture.yaml").write_text(text, encoding="utf-8")
        elif how == "swap":
            shutil.copy(fuzz.work / "cal.npz", folder / name)
        elif how == "mode":
            with Image.open(folder / "led2.png") as image:
                image.convert(mode).save(folder / "led2.tiff")
            (folder / "led2.png").unlink()
        else:
            shape = [int(100 * place) for _, place, _ in edits]
            np.save(folder / "truth_height_mm.npy", np.ones(shape))
        fuzz.run("capture", fuzz_run("reconstruct", fuzz))

    return test


def calibrations(fuzz: Fuzz) -> Callable[[], None]:
    """A calibration with spoilt bytes, or with arrays of another scale, type or shape."""
    arrays = st.sampled_from(sorted(np.load(fuzz.good / "cal.npz").files))

    @given(st.sampled_from(RUNNABLE), arrays, EDITS, st.floats(-40, 40),
           st.sampled_from(["bytes", "scale", "type", "shape", "gone", "negative"]))  # fmt: skip
    def test(
        graph: str, name: str, edits: list[tuple[str, float, bytes]], power: float, how: str
    ) -> None:
        file = fuzz.fresh() / "cal.npz"
        if how == "bytes":
            file.write_bytes(spoilt(file.read_bytes(), edits))
        else:
            with np.load(file) as archive:
                found = dict(archive)
            array = found.pop(name)
            with np.errstate(all="ignore"):
                if array.dtype.kind != "f" or how == "shape":
                    found[name] = array[..., None]
                elif how == "scale":
                    found[name] = (array * 10.0**power).astype(np.float32)
                elif how == "negative":
                    found[name] = -array
                elif how == "type":
                    found[name] = array.astype(np.float64)
            np.savez(file, **found)
        fuzz.run("calibration", fuzz_run(graph, fuzz))

    return test


def recordings(fuzz: Fuzz) -> Callable[[], None]:
    """A recording with spoilt bytes."""

    @given(EDITS)
    def test(edits: list[tuple[str, float, bytes]]) -> None:
        work = fuzz.fresh()
        (file,) = (work / "recording").glob("*.mcap")
        file.write_bytes(spoilt(file.read_bytes(), edits))
        words = [f"recording={work}/recording", f"calibration={work}/cal.npz", f"out={work}/out"]
        fuzz.run("recording", ["run", "replay", *words, "speed=0", "--backend", "numpy"])

    return test


def parameters(fuzz: Fuzz) -> Callable[[], None]:
    """Numbers that a user may type."""
    names = ("radius_mm", "rise_mm", "slant_deg", "distance_mm", "width_px", "height_px",
             "pixel_size_mm", "seed")  # fmt: skip
    targets = ("label.steepest", "label.price", "sigma.floor", "drift.level", "light.floor")

    @given(st.dictionaries(st.sampled_from(names), NUMBERS, max_size=2),
           st.dictionaries(st.sampled_from(targets), NUMBERS, max_size=2))  # fmt: skip
    def test(params: dict[str, str], set_: dict[str, str]) -> None:
        work = fuzz.fresh()
        if set_:
            options = [word for k, v in set_.items() for word in ("--set", f"{k}={v}")]
            fuzz.run("parameter", [*fuzz_run("reconstruct", fuzz), *options])
        values = {**SIZE, **params}
        words = [f"{name}={value}" for name, value in values.items()]
        fuzz.run("parameter", ["run", "simulate", f"out={work}/new", *words, "--backend", "numpy"])

    return test


def fuzz_run(graph: str, fuzz: Fuzz) -> list[str]:
    places = [
        f"capture={fuzz.work}/ball",
        f"calibration={fuzz.work}/cal.npz",
        f"out={fuzz.work}/out",
    ]
    return ["run", graph, *places, "--backend", "numpy"]


def spoilt(content: bytes, edits: list[tuple[str, float, bytes]]) -> bytes:
    """The content with some of its bytes changed."""
    for how, place, new in edits:
        at = int(place * len(content))
        if how == "flip":
            content = content[:at] + new + content[at + len(new) :]
        elif how == "cut":
            content = content[:at]
        elif how == "insert":
            content = content[:at] + new + content[at:]
        elif how == "drop":
            content = content[:at] + content[at + len(new) :]
        elif how == "repeat":
            content = content[:at] + content[max(at - 200, 0) :]
        else:
            content = content[:at] + bytes(len(new)) + content[at + len(new) :]
    return content


def make_inputs(folder: Path) -> None:
    """A capture, a calibration and a recording, as small as they work."""
    folder.mkdir()
    for name, params in (
        ("simulate", {"out": folder / "ball", "radius_mm": 7.0, **SIZE}),
        ("simulate_flat", {"out": folder / "flat", **SIZE}),
        ("calibrate", {"capture": folder / "ball", "flat": folder / "flat", "ball_radius_mm": 7.0,
                       "pixel_size_mm": SIZE["pixel_size_mm"], "out": folder / "cal.npz"}),
    ):  # fmt: skip
        with open_pipeline(name, params, backend="numpy") as pipeline:
            list(pipeline.items())
    images = [np.full((SIZE["height_px"], SIZE["width_px"]), 100, np.uint8) for _ in range(4)]
    session = Session()
    for touch in range(3):
        frames = [
            RawFrame(4 * touch + k, k + 1, time.monotonic(), image)
            for k, image in enumerate(images)
        ]
        light = np.stack(images) / np.float32(255)
        record(
            frames,
            light,
            str(touch),
            folder=folder / "recording",
            provenance=NOBODY,
            session=session,
        )
    session.close()


def in_a_process(words: list[str]) -> Outcome:
    """Run a command in a child that may take no more than its time and memory."""
    start = time.monotonic()
    with tempfile.TemporaryFile() as stream:
        child = os.fork()
        if not child:
            _child(words, stream.fileno())
        while True:
            done, status, usage = os.wait4(child, os.WNOHANG)
            if done:
                break
            if time.monotonic() - start > LONGEST_S:
                os.kill(child, signal.SIGKILL)
            time.sleep(0.005)
        stream.seek(0)
        text = stream.read().decode("utf-8", "replace")
    code = os.waitstatus_to_exitcode(status)
    return Outcome(code, text, time.monotonic() - start, 1024 * usage.ru_maxrss)


def _child(words: list[str], descriptor: int) -> None:
    code = 99
    try:
        most = 4 * MOST_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", 0, closefd=False), write_through=True)
        sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", 0, closefd=False), write_through=True)
        sys.argv = ["tactograph", *words]
        tactograph()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
