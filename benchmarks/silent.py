"""Wrong inputs and right ones: which wrong heights come without a word, which right ones with one?

    python benchmarks/silent.py [--small] [--rig far near] [--kind gamma] [--csv rows.csv]

Each kind of wrong input (benchmarks/silent/wrong.py) is made from right touches at up to three
strengths, on simulated, ray-traced and, where they are present, real sensors.  A wrong input does
harm where its RMSE is above 20 um and above 5 times that of the right input.  Of real sensors no
true height is known: the right input's height stands for it.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
import time
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from silent.rigs import F4, Recipe, Rig, Touch, calibrated, makers, pipeline
from silent.wrong import KINDS, LEVELS, Kind, Scene

from tactograph.graph import InputError

HARM_UM, TIMES, GROSS_UM = 20.0, 5.0, 500.0
HEAD = ("rig", "touch", "kind", "strength", "value", "rmse_um", "right_um", "stated_um", "harm",
        "told", "check", "at_calibration")  # fmt: skip
SMALL_KINDS = ("swapped_neighbours", "gamma_inverse", "led_dead", "ambient", "two_touches",
               "wave", "radius_wrong", "order_rotated", "still_untouched")  # fmt: skip
Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rig", nargs="+", default=None, help=f"of {', '.join(makers(0))}")
    parser.add_argument("--kind", nargs="+", default=None, help="names of kinds, or 'right'")
    parser.add_argument("--graph", nargs="+", default=["reconstruct"], help="also: precise, paper")
    parser.add_argument("--right", type=int, default=75, help="right touches per simulated rig")
    parser.add_argument("--touches", type=int, default=2, help="touches that each kind spoils")
    parser.add_argument("--small", action="store_true", help="a few kinds on one rig, a minute")
    parser.add_argument("--csv", type=Path, default=None, help="all rows, with every figure")
    folder = Path(tempfile.gettempdir()) / "tactograph_silent"
    parser.add_argument("--cache", type=Path, default=folder, help="renderings and calibrations")
    options = parser.parse_args()
    if options.small:
        options.rig, options.right = options.rig or ["near"], min(options.right, 10)
        options.kind, options.touches = options.kind or [*SMALL_KINDS, "right"], 1
    unknown = {*(options.kind or ())} - {*KINDS, "right"}
    if unknown:
        sys.exit(f"no kind {', '.join(sorted(unknown))}; there are {', '.join(KINDS)}")
    warnings.simplefilter("ignore")
    rows: list[Row] = []
    for row in all_rows(options):
        rows.append(row)
        if not rows[1:]:
            print("|", " | ".join(HEAD), "| figures |\n|", "--- |" * (len(HEAD) + 1))
        figures = [f"{name} {value:.3g}" for name, value in row["figures"].items()]
        print("|", " | ".join(cell(row[name]) for name in HEAD), "|", ", ".join(figures), "|",
              flush=True)  # fmt: skip
        if options.csv is not None and (len(rows) % 100 == 0):
            write_csv(options.csv, rows)
    if options.csv is not None:
        write_csv(options.csv, rows)
    print_summary(rows)


def cell(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def all_rows(options: argparse.Namespace) -> Iterator[Row]:
    made = makers(options.right)
    rigs: dict[str, Rig] = {}

    def rig_named(name: str) -> Rig | None:
        if name not in rigs:
            found = made[name](options.cache)
            if found is None:
                print(f"{name}: its captures are not here", file=sys.stderr)
                return None
            rigs[name] = found
        return rigs[name]

    for name in options.rig or made:
        rig = rig_named(name)
        if rig is None:
            continue
        start = time.monotonic()
        graphs = ["gelsight_mini"] if rig.colour else options.graph
        for graph in graphs:
            yield from Trial(rig, graph, options, rig_named).rows()
        print(f"{name}: {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)


class Trial:
    """All rows of a sensor and a graph."""

    def __init__(self, rig: Rig, graph: str, options: argparse.Namespace, rig_named: Any) -> None:
        self.rig, self.graph, self.options, self.rig_named = rig, graph, options, rig_named
        self.file, self.said = calibrated(rig.recipe, rig.colour, options.cache)
        self.base = [(t, self.reference(t)) for t in rig.touches[: options.touches]]

    def reference(self, touch: Touch) -> tuple[F4, float]:
        """The height that counts as true, and the right input's RMSE."""
        frames = self.rig.photograph(touch.light, touch)
        found = self.measure(self.file, frames, touch.height)
        return (found["height"] if touch.height is None else touch.height), found["rmse_um"]

    def measure(self, file: Path, frames: Any, truth: F4 | None) -> Row:
        """Run the graph on images."""
        if frames.dtype.kind == "f" and frames.max() <= 2:
            frames = np.asarray(np.rint(np.clip(frames, 0, 1) * 255), np.uint8)
        try:
            result = pipeline(self.graph, file)(frames=frames)
        except InputError as error:
            return {"rmse_um": np.nan, "stated_um": np.nan, "said": [f"refused: {error}"],
                    "figures": {}, "height": None}  # fmt: skip
        height, error = result["height"], result.outputs.get("error")
        off = np.nan if truth is None else 1e3 * float(np.sqrt(np.mean((height - truth) ** 2)))
        stated = np.nan if error is None else 1e3 * float(np.sqrt(np.mean(error**2)))
        figures = {
            name: float(value)
            for name, value in result["metrics"].items()
            if name == "light_misfit" or name.startswith(("trust", "check"))
        }
        return {"rmse_um": off, "stated_um": stated, "said": list(result.warnings),
                "figures": figures, "height": np.array(height)}  # fmt: skip

    def row(self, touch: str, kind: str, level: int, value: Any, found: Row, right: float) -> Row:
        off, floor = found["rmse_um"], TIMES * np.nan_to_num(right)
        said = found["said"]
        harm = bool(off > max(HARM_UM, floor)) or any(s.startswith("refused") for s in said)
        return {
            "rig": self.rig.name if self.graph != "precise" else f"{self.rig.name} {self.graph}",
            "touch": touch,
            "kind": kind,
            "strength": LEVELS[min(level, 2)] if level >= 0 else "",
            "value": value,
            "rmse_um": off,
            "right_um": right,
            "stated_um": found["stated_um"],
            "harm": harm,
            "told": bool(said),
            "check": "; ".join(" ".join(s.split()[:5]) for s in said),
            "at_calibration": found.get("at_calibration", ""),
            "warnings": " / ".join(said),
            "figures": found["figures"],
            "calibration": found.get("calibration", {}),
        }

    def rows(self) -> Iterator[Row]:
        wanted = self.options.kind
        if wanted is None or "right" in wanted:
            yield from self.right_rows()
        for name, kind in KINDS.items():
            fits = kind.sensors in ("all", "colour" if self.rig.colour else "leds")
            if fits and (wanted is None or name in wanted):
                for level, value in enumerate(kind.strengths):
                    yield from self.wrong_rows(name, kind, level, value)

    def right_rows(self) -> Iterator[Row]:
        for touch in [*self.rig.touches, *self.rig.right]:
            found = self.measure(
                self.file, self.rig.photograph(touch.light, touch), touch.height
            )
            yield self.row(touch.name, "right", -1, "", found, found["rmse_um"])
        found = {"rmse_um": np.nan, "stated_um": np.nan, "said": self.said["warnings"],
                 "figures": {}, "calibration": self.said["figures"]}  # fmt: skip
        yield self.row("", "right calibration", -1, "", found, np.nan)

    def wrong_rows(self, name: str, kind: Kind, level: int, value: Any) -> Iterator[Row]:
        if kind.acts_on == "calibration":
            yield from self.wrong_calibration(name, kind, level, value)
        elif kind.acts_on == "pipeline":
            yield from self.wrong_sensor(name, kind, level, value)
        elif kind.acts_on in ("surface", "leds"):
            yield from self.wrong_surface(name, kind, level, value)
        else:
            for i, (touch, (truth, right)) in enumerate(self.base):
                frames, height = self.spoilt(touch, truth, kind, value, i)
                found = self.measure(self.file, frames, height)
                yield self.row(touch.name, name, level, value, found, right)

    def spoilt(
        self, touch: Touch, truth: F4, kind: Kind, value: Any, i: int
    ) -> tuple[Any, F4]:
        """The wrong images, and the true height."""
        rig = self.rig
        other = rig.touches[(i + 1) % len(rig.touches)] if len(rig.touches) > 1 else rig.right[1]
        rng = np.random.default_rng(zlib.crc32(kind.says.encode()) + i)
        if kind.acts_on == "light":
            scene = Scene(rig.rest, other.light, truth, rig, rng)
            made = rig.photograph(kind.make(touch.light, value, scene), touch)
        else:
            rest = rig.photograph(rig.rest, touch._replace(seed=60 + i))
            scene = Scene(rest, rig.photograph(other.light, other), truth, rig, rng)
            made = kind.make(rig.photograph(touch.light, touch), value, scene)
        return made if isinstance(made, tuple) else (made, truth)

    def wrong_surface(self, name: str, kind: Kind, level: int, value: Any) -> Iterator[Row]:
        simulate = self.rig.simulate
        if simulate is None:
            return
        touch, (truth, right) = self.base[0]
        if kind.acts_on == "surface":
            light, height = simulate(kind.make(self.rig, value), rigid=True)
        else:
            lights = kind.make(simulate.lights, value)
            light, height = simulate(truth, rigid=True, lights=lights)
        found = self.measure(self.file, self.rig.photograph(light, touch), height)
        yield self.row("", name, level, value, found, right)

    def wrong_sensor(self, name: str, kind: Kind, level: int, value: Any) -> Iterator[Row]:
        sibling = kind.make(self.rig) and self.rig_named(kind.make(self.rig))
        if not sibling:
            return
        file, _ = calibrated(sibling.recipe, sibling.colour, self.options.cache)
        for touch, (truth, right) in self.base:
            found = self.measure(file, self.rig.photograph(touch.light, touch), truth)
            yield self.row(touch.name, name, level, value, found, right)

    def wrong_calibration(self, name: str, kind: Kind, level: int, value: Any) -> Iterator[Row]:
        recipe: Recipe | None = kind.make(self.rig.recipe, value, self.rig)
        if recipe is None:
            return
        try:
            file, said = calibrated(recipe, self.rig.colour, self.options.cache)
        except InputError as error:
            found = {"rmse_um": np.nan, "stated_um": np.nan, "figures": {},
                     "said": [f"refused: {error}"], "at_calibration": "refused"}  # fmt: skip
            yield self.row("", name, level, value, found, np.nan)
            return
        for touch, (truth, right) in self.base:
            frames = self.rig.photograph(touch.light, touch)
            if recipe.seen is not None:
                frames, truth = recipe.seen(frames), recipe.seen(truth[None])[0]  # noqa: PLW2901
            found = self.measure(file, frames, truth)
            told = " / ".join(said["warnings"])
            found |= {"at_calibration": told, "calibration": said["figures"]}
            yield self.row(touch.name, name, level, value, found, right)


def write_csv(file: Path, rows: list[Row]) -> None:
    """All rows, a column for every figure."""
    names = {name: None for row in rows for name in row["figures"]}
    quality = {name: None for row in rows for name in row["calibration"]}
    with file.open("w", newline="") as out:
        table = csv.writer(out)
        table.writerow([*HEAD, "warnings", *names, *(f"calibration_{n}" for n in quality)])
        for row in rows:
            table.writerow([
                *(row[name] for name in (*HEAD, "warnings")),
                *(row["figures"].get(name, "") for name in names),
                *(row["calibration"].get(name, "") for name in quality),
            ])  # fmt: skip


def print_summary(rows: list[Row]) -> None:
    """The shares that count, and what stays silent."""
    right = [row for row in rows if row["kind"] == "right"]
    wrong = [row for row in rows if row["kind"] in KINDS and KINDS[row["kind"]].detectable]
    touches = [r for r in wrong if KINDS[r["kind"]].acts_on != "calibration" and r["harm"]]
    recipes = [r for r in wrong if KINDS[r["kind"]].acts_on == "calibration" and r["harm"]]
    print()
    share("right touches with a warning", right, "told")
    share("wrong touches that do harm, warned of or refused", touches, "told")
    share("wrong calibrations that do harm, told at calibration", recipes, "at_calibration")
    share("wrong calibrations that do harm, told at use", recipes, "told")
    gross = [row for row in touches + recipes if row["rmse_um"] > GROSS_UM and not row["told"]]
    print(f"silent above {GROSS_UM / 1e3:g} mm: {len(gross)}")
    for row in gross:
        print(f"  {row['kind']} {row['value']}, {row['rig']} {row['touch']}: "
              f"{row['rmse_um'] / 1e3:.2f} mm")  # fmt: skip


def share(what: str, rows: list[Row], name: str) -> None:
    told = sum(bool(row[name]) for row in rows)
    print(f"{what}: {told} of {len(rows)}" + (f", {100 * told / len(rows):.1f} %" if rows else ""))


if __name__ == "__main__":
    main()
