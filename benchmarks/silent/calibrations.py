"""Calibrations of sensors, kept on disk by what makes them."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, load
from tactograph.graph.cache.result_origin import digest, find_origin
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline

F4 = NDArray[np.float32]


class Recipe(NamedTuple):
    """What a sensor is calibrated with; `seen` is what its camera makes of a touch."""

    balls: F4
    flat: F4
    radius_mm: float
    pixel_mm: float
    more: dict[str, Any]
    seen: Callable[[F4], F4] | None = None


def calibrated(recipe: Recipe, colour: bool, kept_in: Path) -> tuple[Path, dict[str, Any]]:
    """The calibration of a recipe, and what was said and measured while it was made.

    Raises
    ------
    InputError
        If the recipe is refused.
    """
    name = "calibrate_presses" if colour else "calibrate"
    graph = read_graph(name)
    nodes = {name: entry for name, entry in graph.nodes.items() if not entry.op.startswith("plot_")}
    graph = replace(graph, nodes=nodes)
    folder = kept_in / "calibrations" / key_of(name, recipe.balls, recipe.flat, recipe[2:5])
    file, report = folder / "cal.npz", folder / "report.json"
    if not report.exists():
        write(folder / "flat", recipe.flat, colour)
        for i, ball in enumerate(recipe.balls):
            write(folder / "balls" / f"{i:02}", ball, colour)
        report.write_text(json.dumps(calibrate(graph, recipe, folder, file)))
    found = json.loads(report.read_text())
    if found.get("refused"):
        raise InputError(found["refused"])
    return file, found


def calibrate(graph: Graph, recipe: Recipe, folder: Path, file: Path) -> dict[str, Any]:
    """Write a calibration; its warnings and figures, or why it was refused."""
    balls = folder / "balls"
    one = balls / "00" if len(recipe.balls) == 1 else balls
    params = {
        "captures" if "captures" in graph.params else "capture": str(one),
        "flat": str(folder / "flat"),
        "ball_radius_mm": recipe.radius_mm,
        "pixel_size_mm": recipe.pixel_mm,
        "out": str(file),
        **recipe.more,
    }
    try:
        (result,) = open_pipeline(graph, params).items()
    except InputError as error:
        return {"refused": str(error)}
    figures = {k: v for k, v in result["quality"].items() if isinstance(v, int | float)}
    return {"warnings": result.warnings, "figures": figures}


def key_of(graph: str, *data: Any) -> str:
    """A name for what a shipped graph, as its nodes are now, makes of data."""
    key = hashlib.sha256(code_of(graph).encode())
    for part in data:
        key.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return key.hexdigest()[:24]


@cache
def code_of(graph: str) -> str:
    """A hash of a graph and its nodes' source."""
    read = read_graph(graph)
    return digest({**find_origin(read, {})["code"], "engine": "", "graph": read.hash})


def bytes_of(images: F4) -> NDArray[np.uint8]:
    return np.asarray(np.rint(np.clip(images, 0, 1) * 255), np.uint8)


def write(folder: Path, image: F4, colour: bool) -> None:
    """Write a capture, 8 bit as the touches are."""
    folder.mkdir(parents=True, exist_ok=True)
    counts = bytes_of(image)
    planes = {"touch": counts.transpose(1, 2, 0)} if colour else {
        f"led{k}": plane for k, plane in enumerate(counts, start=1)}  # fmt: skip
    for name, plane in planes.items():
        cv2.imwrite(str(folder / f"{name}.png"), plane)


@lru_cache(maxsize=4)
def pipeline(graph: str, file: Path, forced: bool = False) -> Any:
    """A graph that is ready to run with a calibration, also on what it would refuse."""
    return load(graph, calibration=str(file), **({"accept_contradictions": True} if forced else {}))
