"""Print how many valid touches are doubted, family by family of rigs.

    python benchmarks/doubts.py [--family rings traced new] [--new 4] [--seed 7000] [--valid 40]

Nothing that judges a touch is chosen on any of them: a calibration draws its own valid touches.
`new` are rings of LEDs of any number, slant, distance and turn, made anew of the seed.  A touch is
right where its height is within 20 um.  Doubts of others are counted apart.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from one_run import row
from silent.calibrations import Recipe, bytes_of, calibrated, pipeline
from silent.rigs import MIDDLE, RINGS, SHARED, Rig, Ring, Touch, images, simulated

from tactograph.graph import InputError

VALID_UM, FALSE_ALARMS = 20.0, 0.01
TRACED = (
    "far28", "near33", "hand", "hand_ideal", "hand_discs", "hand_perspective", "hand_bounce",
    "hand_gloss",
)  # fmt: skip
"""Ray-traced rigs whose lens is even, or which say so themselves."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--family", nargs="+", default=["rings", "traced", "new"])
    parser.add_argument("--new", type=int, default=4, help="new rigs")
    parser.add_argument("--seed", type=int, default=7000, help="of the new rigs and their touches")
    parser.add_argument("--valid", type=int, default=40, help="touches of each simulated rig")
    parser.add_argument("--cache", type=Path, help="folder for renderings and calibrations",
                        default=Path(tempfile.gettempdir()) / "tactograph_silent")  # fmt: skip
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # A machine without an OpenCL device says so at every load.
    print("| family | rig | valid touches doubted | others doubted |")
    print("| --- | --- | --- | --- |")
    for family in options.family:
        total = np.zeros(4, int)
        for rig in rigs(family, options):
            counts = judged(rig, options.cache)
            total += counts
            print_row(family, rig.name, counts)
        print_row(family, f"**all, {total[0] / max(total[1], 1):.1%}**", total)


def print_row(family: str, name: str, counts: Any) -> None:
    row(family, name, f"{counts[0]} of {counts[1]}", f"{counts[2]} of {counts[3]}")


def rigs(family: str, options: argparse.Namespace) -> Iterator[Rig]:
    if family == "rings":
        for name in ("far", "near", "six"):
            yield simulated(name, options.cache, options.valid)
    elif family == "traced":
        for name in TRACED:
            if (SHARED / "raytraced" / name).is_dir():
                yield traced(name)
    else:
        for number in range(options.new):
            name = f"new{options.seed + number}"
            RINGS[name] = new_ring(options.seed + number)
            first = 1000 * (options.seed + number)
            yield simulated(name, options.cache, options.valid, first)


def new_ring(seed: int) -> Ring:
    rng = np.random.default_rng(seed)
    leds, slant = int(rng.integers(4, 7)), float(rng.uniform(26, 42))
    away, turn = float(np.exp(rng.uniform(np.log(40), np.log(400)))), float(rng.uniform(0, 90))
    return Ring("simulate_press", leds, slant, away, turn, MIDDLE)


def traced(name: str) -> Rig:
    """All touches of a ray-traced rig."""
    folder = SHARED / "raytraced" / name
    facts = json.loads((folder / "flat/scene.json").read_text())
    captures = sorted(f.parent for f in folder.glob("*/truth_height_mm.npy"))
    balls = [images(f) for f in captures if f.name.startswith("calibration")]
    touches = [
        Touch(f.name, images(f), np.load(f / "truth_height_mm.npy"))
        for f in captures
        if not f.name.startswith("calibration")
    ]
    more = {"camera_mm": facts["camera_mm"]} if facts.get("camera_mm") else {}
    radius = 6.0 if name.startswith("hand") else 7.0
    flat = images(folder / "flat")
    recipe = Recipe(np.stack(balls), flat, radius, facts["pixel_size_mm"], more)
    return Rig(f"raytraced_{name}", recipe, touches, np.zeros(0), flat, [])


def judged(rig: Rig, cache: Path) -> list[int]:
    """Valid touches doubted, valid touches, others doubted, others."""
    file, _ = calibrated(rig.recipe, rig.colour, cache)
    counts = [0, 0, 0, 0]
    for touch in (*rig.touches, *rig.valid):
        frames = bytes_of(rig.photograph(touch.light, touch))
        try:
            result = pipeline("reconstruct", file, forced=True)(frames=frames)
        except InputError:
            continue
        off = 1e3 * np.sqrt(np.mean(np.square(result["height"] - touch.height)))
        which = 0 if off < VALID_UM else 2
        counts[which] += bool(result["metrics"]["trust"] < FALSE_ALARMS)
        counts[which + 1] += 1
    return counts


if __name__ == "__main__":
    main()
