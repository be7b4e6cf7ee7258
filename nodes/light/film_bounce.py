"""Compute the light from film to film: the interreflection of film that is not flat.

Long because it is computed on cells of two sizes, which one kernel lays out and one sweeps.
"""

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, InputError, node
from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import F4, Film, Height, Light, PixelSize, Slope, Still
from tactograph.nodes.optics.between_cells import between_cells
from tactograph.nodes.optics.coat import upload_curve
from tactograph.nodes.optics.coated_bounce import coated, source_rows
from tactograph.nodes.optics.radiosity import (
    COATED_AZIMUTHS,
    Grid,
    cell_grid,
    cells_of,
    extrapolated,
    larger_cells,
    means,
)
from tactograph.nodes.optics.sweep import arriving, matt, steps_in_table

MAX_ALBEDO = 0.95
CELL_ITEMS, GROUP_CELLS = 8, 32
"""On a GPU, the work-items that share a cell's azimuths, and the cells of a work-group."""
DEFAULT_CELLS = 4800
"""Default number of cells in a frame."""


@node(
    neutral=0.0,
    tolerance=Close(3e-5, 1e-3, share=2e-3, why="rounding decides what just rises over a horizon"),
)
def film_bounce(
    light: Light,
    height: Height,
    film: Film,
    pixel: PixelSize,
    before: Light | None = None,
    slope: Slope | None = None,
    recall: Light | None = None,
    still: Still | None = None,
    *,
    cells: Annotated[int, Interval(ge=1, le=100000)] = DEFAULT_CELLS,
    azimuths: Annotated[int, Interval(ge=2, le=64)] = COATED_AZIMUTHS,
    share: Annotated[float, Interval(gt=0, le=3)] = 0.5,
    from_above: bool = False,
) -> Light | None:
    r"""Return the part of the light that comes from other places of the film.

    The light E_j that the camera sees of a cell includes all earlier bounces.  So one sum over the
    film that a place sees (equation B1, `sweep`) includes all bounces (radiosity; S. Nayar,
    K. Ikeuchi and T. Kanade, "Shape from interreflections", 1991).  E_j is the light relative to
    the film at rest times the irradiance there, by the inverse square and the cosine.  The
    result is again relative to the film at rest.  Subtracted from `light`, it leaves what comes
    from the LED.  A flat film does not light itself; `film.rim` mm of flat film surround the
    frame.  Film hidden by nearer film contributes nothing.  A coated film also mirrors light
    (`coated_bounce`).

    Where the film is folded, the cells miss light.  Cells twice as large miss more, and the
    difference gives a correction (Richardson extrapolation, 1911).

    Parameters
    ----------
    light : K x H x W, as captured, 1 on the film at rest
    height : H x W in mm, as the camera sees it (`view_slope`)
    film : the LEDs' and the film's properties; `albedo` is at most 0.95
    pixel : mm per px of `light` and `height`
    before
        K x H x W, the result of the previous pass, if height and bounce are computed in turn.
    slope
        2 x H x W, the film's slope.  None: differences of `height`, which are less accurate on
        large pixels.
    recall, still
        K x H x W, this node's result for the previous item (``previous.NODE``), and 1 if it still
        holds because nothing has moved (`light_stays`).
    cells
        About how many cells a frame has.  They are squares of pixels, and the result is
        interpolated between them.  A quarter of the number makes them twice as wide.
    azimuths : number of azimuths that a cell looks along under a coat; half as many on a matt film
    share
        Relaxation factor: result = before + share (new - before).  Below 1 it damps
        oscillation; above 1 it speeds up slow convergence.
    from_above
        Whether `light` and `height` are those straight below each pixel, from `render`.
        The camera's place then matters only for a coat.

    Returns
    -------
    K x H x W; None if the albedo is 0.

    Raises
    ------
    InputError
        If the albedo is not between 0 and 0.95.
    """
    _check(film.albedo)
    if film.albedo == 0:
        return None
    if still and recall is not None:
        return recall

    def on_cells(grid: Grid) -> F4:
        """The bounced light on the cells of one grid."""
        camera = 0.0 if from_above else film.camera
        cells = cells_of(height, film.lights, np.float32(pixel), grid, slope, camera)
        frame = slice(None), *grid.frame
        sources = cells.rest.copy()
        sources[frame] *= means(light, grid.factor)
        law = matt(sources) if film.refraction == 1 else coated(film, cells, sources, grid)
        return np.float32(film.albedo) * arriving(cells, grid, camera, law) / cells.rest[frame]

    grid = cell_grid(height.shape, pixel, cells, film.rim, film.refraction, azimuths)
    bounced = between_cells(extrapolated(on_cells, grid), height.shape, grid.factor)
    return bounced if before is None else before + np.float32(share) * (bounced - before)


film_bounce.idle(lambda film_albedo: film_albedo == 0)


@film_bounce.opencl()
def _launch(run: Launch) -> None:
    size = run.sizes["H"], run.sizes["W"]
    inputs, settings, out = run.inputs, run.settings, run.outputs["film_bounce"]
    pixel, albedo, recall = inputs["pixel"], inputs["film.albedo"], inputs.get("recall")
    _check(albedo)
    work = run.in_row_lanes(*size)
    if inputs.get("still") and recall is not None:
        run.kernel(
            "interpolate", work, None, recall, out, *size, 1, *size, 0.0, constants=_constants(run)
        )
        return
    film = inputs["film.rim"], inputs["film.refraction"]
    grid = cell_grid(size, pixel, settings["cells"], *film, settings["azimuths"])
    larger = _launch_on_cells(run, larger_cells(grid))
    bounced = _launch_on_cells(run, grid, larger)
    arguments = bounced, inputs.get("before"), out, *size, grid.factor, grid.rows, grid.columns
    run.kernel("interpolate", work, *arguments, settings["share"], constants=_constants(run))


def _constants(run: Launch) -> dict[str, int]:
    return {"LEDS": run.sizes["K"], "COATED": int(run.inputs["film.refraction"] != 1)}


def _launch_on_cells(run: Launch, grid: Grid, larger: DeviceArray | None = None) -> DeviceArray:
    """Enqueue what `film_bounce` does on cells, and extrapolate by the result on `larger` cells."""
    inputs, constants = run.inputs, _constants(run)
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    every, lights = math.prod(grid.whole), inputs["film.lights"]
    camera = 0.0 if run.settings["from_above"] else inputs["film.camera"]
    rough = inputs["film.roughness"], inputs["film.refraction"]
    of_coat = inputs["film.diffuse"], upload_curve(run, *rough), inputs["film.base"], *rough
    table = run.scratch((7 + 2 * count, every))
    sources = run.scratch((source_rows(count), every)) if constants["COATED"] else None
    run.kernel(
        "lay_out", run.in_row_lanes(*grid.whole),
        inputs["light"], inputs["height"], inputs.get("slope"), lights, inputs["pixel"], table,
        *size, grid.factor, grid.rows, grid.columns, grid.rim, camera,
        sources, *of_coat, inputs["film.camera"],
        constants=constants,
    )  # fmt: skip
    bounced = run.scratch((count, grid.rows, grid.columns))
    steps = run.keep(grid, lambda: run.put(steps_in_table(grid)))
    shared = (1, 1) if run.lanes > 1 else (GROUP_CELLS, CELL_ITEMS)
    side = math.isqrt(run.lanes)
    run.kernel(
        "throw_light", (shared[1], -(-grid.rows // side) * -(-grid.columns // side)),
        table, sources, bounced, lights, *of_coat, inputs["film.camera"],
        grid.rows, grid.columns, grid.rim, grid.width, grid.film,
        camera, grid.azimuths, steps, steps.shape[1], inputs["film.albedo"], larger,
        local=shared, constants=constants,
    )  # fmt: skip
    return bounced


@film_bounce.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs above a film that extends little beyond the frame; every second film has no coat.

    The film is rough and tilted, but not extremely steep: seen edge-on, what one place sees of
    another depends on the last digit of a height.
    """
    sideways = rng.uniform(-20, 20, (K, 2))
    lights = np.column_stack([sideways, rng.uniform(15, 40, K)]).astype(np.float32)
    matt = {"film.refraction": 1.0} if rng.random() < 1 / 2 else {}
    rim, albedo = float(rng.uniform(0, 0.6)), float(rng.uniform(0.2, 0.7))
    pixel, (p, q) = float(rng.uniform(0.01, 0.2)), rng.uniform(-1, 1, 2)
    rough = rng.uniform(-2, 2, (H, W)) + p * np.arange(W) + q * np.arange(H)[:, None]
    height = {"height": (pixel * rough).astype(np.float32), "pixel": pixel}
    return {"film.lights": lights, "film.rim": rim, "film.albedo": albedo, **height, **matt}


def _check(albedo: float) -> None:
    if not 0 <= albedo <= MAX_ALBEDO:
        raise InputError(
            f"albedo is {albedo:g}; give the share of the light that the film "
            f"reflects, 0 to {MAX_ALBEDO:g}"
        )
