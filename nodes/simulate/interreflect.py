"""Add the light reflected from film to film to that of the LEDs."""

from __future__ import annotations

import math
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Film, Height, Light, LightPositions, PixelSize
from tactograph.nodes.optics.between_cells import between_cells
from tactograph.nodes.optics.bounce import bounce, launch_bounce, launch_cells
from tactograph.nodes.optics.film import matt_film
from tactograph.nodes.optics.radiosity import (
    Grid,
    cell_grid,
    cells_of,
    extrapolated,
    larger_cells,
    means,
)
from tactograph.nodes.optics.sweep import sight

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import DeviceArray, Launch

MIN_REST_LIGHT = np.float32(1e-6)


@node(
    neutral="light",
    tolerance=Close(1e-5, 1e-3, why="sums over all cells, in another order, several times"),
)
def interreflect(
    light: Light,
    rest: Light,
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    *,
    albedo: Annotated[float, Interval(ge=0, le=0.95)] = 0.7,
    bounces: Annotated[int, Interval(ge=1, le=12)] = 8,
    cells: Annotated[int, Interval(ge=1, le=100000)] = 19200,
    rim_mm: Annotated[float, Interval(ge=0, le=50)] = 2.0,
    coat_alpha: Annotated[float, Interval(ge=0, le=1)] = 0.0,
    refractive_index: Annotated[float, Interval(ge=1, le=3)] = 1.5,
    camera_mm: Annotated[float, Interval(ge=0, le=1e6)] = 0.0,
) -> Light:
    """Return the light of a film that lights itself, bounce after bounce.

    Radiosity: each round applies the sum of `film_bounce` to the light of the LEDs plus that of
    the previous round.  A reconstruction that uses the same model recovers the LEDs' light.

    Parameters
    ----------
    light
        K x H x W, from the LEDs alone.
    rest
        K x H x W, the same for the film at rest.
    height
        H x W, mm.
    lights
        K x 3, mm.
    pixel
        mm per px.
    albedo
        Share of the light that the film reflects; 0 is a film that does not light itself.
    bounces
        Number of bounces; at an albedo of 0.7 the light has converged to a thousandth after 5.
    cells
        Largest number of cells, which are squares of pixels.
    rim_mm
        How far the film extends beyond the frame, flat and at rest.
    coat_alpha, refractive_index, camera_mm
        As for `render`: roughness of a coat (0 for none), its index, and height of the pupil.
    """
    if albedo == 0:
        return light.copy()
    film = matt_film(lights)._replace(
        base=albedo,
        albedo=albedo,
        roughness=coat_alpha,
        refraction=refractive_index if coat_alpha > 0 else 1.0,
        camera=1 / camera_mm if camera_mm else 0.0,
    )
    relative: F4 = np.divide(light, np.maximum(rest, MIN_REST_LIGHT), dtype=np.float32)
    grid = cell_grid(height.shape, pixel, cells, rim_mm, film.refraction)
    on_cells = partial(_on_cells, relative, height, film, pixel, bounces)
    added = between_cells(extrapolated(on_cells, grid), height.shape, grid.factor)
    # What two sizes of cells tell of the foot of a wall may lie below zero.
    return np.asarray(np.maximum(light + rest * added, np.float32(0)))


def _on_cells(relative: F4, height: F4, film: Film, pixel: float, bounces: int, grid: Grid) -> F4:
    """The light of all bounces on a grid of cells, relative to the film at rest."""
    cells = cells_of(height, film.lights, np.float32(pixel), grid)
    direct = means(relative, grid.factor)
    bounced = np.zeros_like(direct)
    # What the cells see of one another is the same for every bounce.
    seen = cache(partial(sight, cells, grid, 0.0))
    for _ in range(bounces):
        bounced = bounce(direct + bounced, film, cells, grid, seen, from_above=True)
    return bounced


@interreflect.opencl()
def _launch(run: Launch) -> None:
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    light, rest, pixel = (run.inputs[name] for name in ("light", "rest", "pixel"))
    settings, out = run.settings, run.outputs["interreflect"]
    coated = settings["coat_alpha"] > 0 and settings["albedo"] > 0
    refraction = settings["refractive_index"] if coated else 1.0
    film = settings["rim_mm"], refraction
    grid = cell_grid((size[0], size[1]), pixel, settings["cells"], *film)
    constants = {"LEDS": count, "COATED": int(refraction != 1)}
    relative = run.scratch((count, *size))
    pixels, everything = run.in_lanes(count, *size), count * math.prod(size)
    run.kernel("relative", pixels, light, rest, relative, everything, constants=constants)
    larger = _launch_on_cells(run, relative, larger_cells(grid), constants)
    bounced = _launch_on_cells(run, relative, grid, constants, larger)
    shape = grid.factor, grid.rows, grid.columns
    arguments = light, rest, bounced, out, *size, *shape
    run.kernel("add_light", run.in_row_lanes(count, *size), *arguments, constants=constants)


def _launch_on_cells(
    run: Launch,
    relative: DeviceArray,
    grid: Grid,
    constants: dict[str, int],
    larger: DeviceArray | None = None,
) -> DeviceArray:
    """Enqueue `_on_cells`, and extrapolate by the result on `larger` cells."""
    settings, count, lights = run.settings, run.sizes["K"], run.inputs["lights"]
    direct, table = (
        launch_cells(run, grid, constants, relative, None, lights, 0.0) for _ in range(2)
    )
    bounced, frame = run.scratch((count, grid.rows, grid.columns)), grid.rows * grid.columns
    none = run.keep(("no diffuse share", count), lambda: run.upload(np.zeros(count, np.float32)))
    albedo, pupil = settings["albedo"], settings["camera_mm"]
    camera = 1 / pupil if pupil else 0.0
    coat = lights, none, albedo, settings["coat_alpha"], settings["refractive_index"], camera
    shape = grid.rows, grid.columns, grid.rim
    last = settings["bounces"] - 1
    for number in range(last + 1):
        if number:
            run.kernel("add_bounce", (frame,), direct, bounced, table, *shape, constants=constants)
        told = larger if number == last else None
        launch_bounce(run, grid, constants, table, coat, 0.0, albedo, bounced, told)
    return bounced


@interreflect.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs before a film that is nowhere black at rest and smooth enough to converge."""
    sideways = rng.uniform(-20, 20, (K, 2))
    lights: F4 = np.column_stack([sideways, rng.uniform(15, 40, K)]).astype(np.float32)
    rest = rng.uniform(0.3, 1, (K, H, W)).astype(np.float32)
    y, x = np.indices((H, W)).astype(np.float32)
    height = np.float32(0.3) * np.sin(x / np.float32(9)) * np.cos(y / np.float32(7))
    return {"lights": lights, "rest": rest, "height": np.asarray(height, np.float32)}
