"""Captures of a matt film under near LEDs, 160 x 120 px of 0.1 mm, whose true heights are known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph.files.read_graph import Source, read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.simulate.expose import expose
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.shape_flat import shape_flat
from tests.fixtures import few_ranks, of_matt_film, without_ranks

PIXEL_MM, BALL_MM = 0.1, 4.0
CANVAS = {"width_px": 160, "height_px": 120, "pixel_size_mm": PIXEL_MM}
FLAT = shape_flat(**CANVAS).height
BALL = shape_ball(radius_mm=BALL_MM, rise_mm=1.2, **CANVAS).height
TOUCH = shape_ball(radius_mm=5.0, rise_mm=0.8, offset_mm=(0.6, -0.4), **CANVAS).height

Image = NDArray[np.uint8]


def leds(count: int = 4, distance_mm: float = 40.0) -> F4:
    """Places of LEDs in a ring, in mm."""
    return light_ring(count=count, slant_deg=40.0, distance_mm=distance_mm, first_azimuth_deg=45.0)


def taken(height: F4, seed: int = 0, lights: F4 | None = None) -> Image:
    """The image of an 8-bit camera under each LED: K x H x W."""
    light = render(height, PIXEL_MM, leds() if lights is None else lights).light
    return np.rint(255 * expose(light, seed=seed).image).clip(0, 255).astype(np.uint8)


def write(folder: Path, images: Image) -> str:
    """One image per LED."""
    folder.mkdir(parents=True)
    for k, image in enumerate(images, start=1):
        cv2.imwrite(str(folder / f"led{k}.png"), image)
    return str(folder)


def see(folder: Path, camera: Callable[[Image], Image]) -> None:
    """The film at rest, under a ball, and under a touch, through a camera."""
    for seed, (name, height) in enumerate({"flat": FLAT, "ball": BALL, "touch": TOUCH}.items()):
        write(folder / name, camera(taken(height, seed)))


def calibrated(
    folder: Path,
    size_mm: float | tuple[float, float] = PIXEL_MM,
    out: str = "cal.npz",
    ranked: bool = True,
    searched: bool = False,
) -> Any:
    """The result of `calibrate` for these captures.

    Touches are checked if it is `ranked`; whether the film is more than matt if it is `searched`.
    """
    graph = read_graph("calibrate")
    graph = graph if searched else of_matt_film(graph)
    images = {"capture": str(folder / "ball"), "flat": str(folder / "flat")}
    known = {"ball_radius_mm": BALL_MM, "pixel_size_mm": size_mm}
    params = {**images, **known, "out": str(folder / out), "accept_contradictions": True}
    return run(few_ranks(graph) if ranked else without_ranks(graph), **params)


def run(graph: Source, sinks: bool = True, **params: Any) -> Any:
    """The result of a graph's only item."""
    (result,) = open_pipeline(graph, params, sinks=sinks).items()
    return result


def warnings_of(result: Any) -> list[str]:
    """The warnings of a result, except that of a missing device."""
    return [line for line in result.warnings if "OpenCL" not in line]
