"""Print which wrong inputs give a height without a word, and which valid ones a warning.

    python benchmarks/silent.py [--rig far near] [--kind gamma valid] [--csv rows.csv] [--small]

Each kind of wrong input (`benchmarks/silent/wrong.py`) is made of valid touches, at up to three
strengths, on simulated, ray-traced and, where they are present, real sensors; of a sensor that
takes long to calibrate, wrong calibrations at the last strength.  A wrong input does harm where its
RMSE is above 20 um, and above 5 times the valid input's or 5 times the stated error.  Of a real
sensor no true height is known: the valid input's height stands for it.  A touch counts as valid
where its height is right within 20 um or its stated error; doubts of others are counted apart.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from one_run import row as print_row
from silent.calibrations import F4, bytes_of, calibrated, pipeline
from silent.rigs import Rig, Touch, makers
from silent.wrong import KINDS, Kind, Scene

from tactograph.graph import InputError

HARM_UM, TIMES, GROSS_UM = 20.0, 5.0, 500.0
LEVELS = ("weak", "middle", "strong")
NOT_OF_LIGHT = "find_contact:"
"""How a warning begins that doubts neither light nor height."""
FIGURES = ("trust", "check")
COLUMNS = ("rig", "graph", "touch", "kind", "strength", "value", "rmse_um", "valid_um",
           "stated_um", "harm", "reported", "check", "reported_at_calibration")  # fmt: skip
SMALL = ("valid", "swapped_neighbours", "order_rotated", "gamma", "another_gel", "led_twice",
         "ambient", "two_touches", "wave", "another_sensor", "radius")  # fmt: skip
Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rig", nargs="+", choices=[*makers(0)], metavar="RIG",
                        help=f"of {', '.join(makers(0))}")  # fmt: skip
    parser.add_argument("--kind", nargs="+", choices=["valid", *KINDS], metavar="KIND",
                        help=f"valid, or of {', '.join(KINDS)}")  # fmt: skip
    parser.add_argument("--graph", nargs="+", default=["reconstruct"], help="also: precise, paper")
    parser.add_argument("--valid", type=int, default=75, help="valid touches per simulated rig")
    parser.add_argument("--touches", type=int, default=2, help="touches that each kind spoils")
    parser.add_argument("--small", action="store_true", help="one rig, a few kinds: a minute")
    parser.add_argument("--csv", type=Path, help="write all rows, with warnings and figures")
    parser.add_argument("--cache", type=Path, help="folder for renderings and calibrations",
                        default=Path(tempfile.gettempdir()) / "tactograph_silent")  # fmt: skip
    options = parser.parse_args()
    if options.small:
        options.rig, options.kind = options.rig or ["near"], options.kind or SMALL
        options.valid, options.touches = 10, 1
    warnings.simplefilter("ignore")  # A machine without an OpenCL device says so at every load.
    print_row(*COLUMNS, "figures")
    print_row(*["---"] * (len(COLUMNS) + 1))
    rows: list[Row] = []
    for trial in trials(options):
        for row in trial.rows():
            rows.append(row)
            print_row(*(cell(row[name]) for name in COLUMNS), figures(row["figures"]))
        if options.csv is not None:
            write_csv(options.csv, rows)
    print_summary(rows)


def trials(options: argparse.Namespace) -> Iterator[Trial]:
    """Each sensor with each graph."""
    sensors = makers(options.valid)
    rigs: dict[str, Rig | None] = {}

    def named(name: str) -> Rig | None:
        if name not in rigs:
            rigs[name] = sensors[name](options.cache)
        return rigs[name]

    for name in options.rig or sensors:
        rig = named(name)
        if rig is None:
            print(f"{name} is left out: its captures are not here", file=sys.stderr)
            continue
        for graph in ["gelsight_mini"] if rig.colour else options.graph:
            yield Trial(rig, graph, options, named)


class Trial:
    """All rows of a sensor and a graph."""

    def __init__(
        self,
        rig: Rig,
        graph: str,
        options: argparse.Namespace,
        named: Callable[[str], Rig | None],
    ) -> None:
        self.rig, self.graph, self.options, self.named = rig, graph, options, named
        self.file, self.said = calibrated(rig.recipe, rig.colour, options.cache)
        self.usual = forms(self.said["warnings"])
        self.base = [self.reference(touch) for touch in rig.touches[: options.touches]]

    def reference(self, touch: Touch) -> tuple[Touch, F4, float]:
        """A touch, the height that counts as true, and the valid input's RMSE in um."""
        found = self.measure(self.file, self.rig.photograph(touch.light, touch), touch.height)
        height = found["height"] if touch.height is None else touch.height
        return touch, height, found["rmse_um"]

    def measure(self, file: Path, images: Any, truth: F4 | None) -> Row:
        """Run the graph on 8-bit images, or on integers and floats out of range as they are."""
        fractions = images.dtype.kind == "f" and images.max() < 10
        frames, said = bytes_of(images) if fractions else images, []
        try:
            result = pipeline(self.graph, file)(frames=frames)
        except InputError as error:
            try:
                result = pipeline(self.graph, file, forced=True)(frames=frames)
            except InputError:
                return refused(error)
            said = [f"refused: {error}"]
        height, error = result["height"], result.outputs.get("error")
        figures = {n: float(v) for n, v in result["metrics"].items() if n.startswith(FIGURES)}
        return {
            "height": np.array(height),
            "rmse_um": np.nan if truth is None else micrometres(height - truth),
            "stated_um": np.nan if error is None else micrometres(error),
            "said": said + [s for s in result.warnings if not s.startswith(NOT_OF_LIGHT)],
            "figures": figures,
        }

    def rows(self) -> Iterator[Row]:
        kinds = self.options.kind
        if kinds is None or "valid" in kinds:
            for touch in (*self.rig.touches, *self.rig.valid):
                images = self.rig.photograph(touch.light, touch)
                found = self.measure(self.file, images, touch.height)
                yield self.row("valid", touch.name, "", "", found, found["rmse_um"])
            found = refused("") | {"height": None, "calibration": self.said}
            found["said"] = self.said["warnings"]
            yield self.row("valid calibration", "", "", "", found, np.nan)
        for name, kind in KINDS.items():
            fits = kind.sensors in ("all", "colour" if self.rig.colour else "leds")
            if fits and (kinds is None or name in kinds):
                levels = list(enumerate(kind.strengths))
                once = kind.spoils == "recipe" and self.rig.slow
                for level, value in levels[-1:] if once else levels:
                    for found, touch, right in self.wrong(kind, value):
                        yield self.row(name, touch, LEVELS[min(level, 2)], value, found, right)

    def wrong(self, kind: Kind, value: Any) -> Iterator[tuple[Row, str, float]]:
        """What comes of a kind of wrong input: of each touch, of its surface, or of none."""
        base = self.base[:1] if kind.spoils in ("surface", "leds") else self.base
        for i, (touch, _, right) in enumerate(base):
            scene = self.scene(i, kind)
            if kind.spoils in ("recipe", "sensor"):
                found = self.calibrated_wrong(kind, value, scene, touch)
            else:
                found = self.spoilt(kind, value, scene, touch)
            if found is None:
                return
            yield found, "" if kind.spoils == "surface" else touch.name, right

    def scene(self, i: int, kind: Kind) -> Scene:
        rig, (touch, truth, _) = self.rig, self.base[i]
        others = [other for other in (*rig.touches, *rig.valid) if other is not touch]
        rest, other = rig.rest, others[0].light
        if kind.spoils != "light":
            rest = rig.photograph(rest, touch._replace(seed=60 + i))
            other = rig.photograph(other, others[0])
        rng = np.random.default_rng(zlib.crc32(kind.says.encode()) + i)
        return Scene(rest, other, truth, rig, rng)

    def spoilt(self, kind: Kind, value: Any, scene: Scene, touch: Touch) -> Row | None:
        """A wrong touch under the valid calibration."""
        simulate, truth = self.rig.simulate, scene.height
        if kind.spoils in ("surface", "leds"):
            if simulate is None:
                return None
            if kind.spoils == "surface":
                light, truth = simulate(kind.make(None, value, scene), rigid=True)
            else:
                lights = kind.make(simulate.lights, value, scene)
                light, truth = simulate(truth, rigid=True, lights=lights)
            images = self.rig.photograph(light, touch)
        elif kind.spoils == "light":
            images = self.rig.photograph(kind.make(touch.light, value, scene), touch)
        else:
            images = kind.make(self.rig.photograph(touch.light, touch), value, scene)
        if isinstance(images, tuple):
            images, truth = images
        return self.measure(self.file, images, truth)

    def calibrated_wrong(self, kind: Kind, value: Any, scene: Scene, touch: Touch) -> Row | None:
        """A valid touch under a wrong calibration."""
        rig, images, truth = self.rig, self.rig.photograph(touch.light, touch), scene.height
        recipe = kind.make(rig.recipe, value, scene)
        if kind.spoils == "sensor":
            another = recipe and self.named(recipe)
            recipe = another and another.recipe
        if not recipe:
            return None
        try:
            file, said = calibrated(recipe, rig.colour, self.options.cache)
        except InputError as error:
            return refused(error) | {"calibration": {"warnings": ["refused"], "figures": {}}}
        if recipe.seen is not None:
            images, truth = recipe.seen(images), recipe.seen(truth[None])[0]
        found = self.measure(file, images, truth)
        return found | ({"calibration": said} if kind.spoils == "recipe" else {})

    def row(self, kind: str, touch: str, level: str, value: Any, found: Row, right: float) -> Row:
        off, stated, said = found["rmse_um"], found["stated_um"], found["said"]
        floors = [f for f in (right, stated) if not np.isnan(f)] or [0.0]
        calibration = found.get("calibration", {"warnings": [], "figures": {}})
        return {
            "rig": self.rig.name,
            "graph": self.graph,
            "touch": touch,
            "kind": kind,
            "strength": level,
            "value": value,
            "rmse_um": off,
            "valid_um": right,
            "stated_um": stated,
            "harm": "height" not in found or bool(off > max(HARM_UM, TIMES * min(floors))),
            "reported": bool(said),
            "check": "; ".join(" ".join(s.split()[:5]) for s in said),
            "reported_at_calibration": not self.usual >= forms(calibration["warnings"]),
            "warnings": " / ".join(said),
            "calibration_warnings": " / ".join(calibration["warnings"]),
            "figures": found["figures"]
            | {f"calibration/{name}": figure for name, figure in calibration["figures"].items()},
        }


def forms(warnings: list[str]) -> set[str]:
    """Warnings without their numbers."""
    return {re.sub(r"[-\d.]+", "#", warning) for warning in warnings}


def refused(error: object) -> Row:
    """No height: it does harm to nobody, and counts as reported."""
    return {"rmse_um": np.nan, "stated_um": np.nan, "said": [f"refused: {error}"], "figures": {}}


def micrometres(values: F4) -> float:
    return 1e3 * float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def write_csv(file: Path, rows: list[Row]) -> None:
    """All rows, with a column for every figure."""
    flat = [{**row, **row["figures"]} for row in rows]
    names = dict.fromkeys(name for row in flat for name in row if name != "figures")
    with file.open("w", newline="") as out:
        table = csv.DictWriter(out, list(names), extrasaction="ignore")
        table.writeheader()
        table.writerows(flat)


def print_summary(rows: list[Row]) -> None:
    """The shares that count, and what stays silent."""
    harmful = [row for row in rows if row["kind"] in KINDS and row["harm"]]
    wrong = [row for row in harmful if KINDS[row["kind"]].detectable]
    recipes = [row for row in wrong if KINDS[row["kind"]].spoils == "recipe"]
    touches = [row for row in wrong if KINDS[row["kind"]].spoils != "recipe"]
    unseen = [row for row in harmful if not KINDS[row["kind"]].detectable]
    print()
    valid = [row for row in rows if row["kind"] == "valid"]
    off = [row for row in valid if row["rmse_um"] > np.nanmax([HARM_UM, row["stated_um"]])]
    share("valid touches with a warning", [row for row in valid if row not in off])
    share(f"valid inputs whose height is more than {HARM_UM:g} um off, reported", off)
    share("wrong touches that do harm, warned of or refused", touches)
    name = "reported_at_calibration"
    share("wrong calibrations that do harm, reported after calibrating", recipes, name)
    share("wrong calibrations that do harm, reported in use", recipes)
    share("errors that do not show in the light, which do harm", unseen)
    gross = [row for row in wrong if row["rmse_um"] > GROSS_UM and not row["reported"]]
    print(f"silent and more than {GROSS_UM / 1e3:g} mm off: {len(gross)}")
    for row in gross:
        name = f"{row['kind']} {cell(row['value'])}, {row['rig']} {row['graph']} {row['touch']}"
        print(f"- {name}: {row['rmse_um'] / 1e3:.2f} mm")


def share(what: str, rows: list[Row], name: str = "reported") -> None:
    count = sum(row[name] for row in rows)
    print(f"- {what}: {count} of {len(rows)}" + (f", {count / len(rows):.1%}" if rows else ""))


def cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def figures(found: dict[str, float]) -> str:
    lines = (f"{n} {v:.3g}" for n, v in found.items() if not n.startswith("calibration/"))
    return ", ".join(lines)


if __name__ == "__main__":
    main()
