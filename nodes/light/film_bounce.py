"""The light that the film throws on itself: interreflection of a film that is no longer flat."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, InputError, node
from tactograph.nodes import Film, Height, Light, PixelSize, Slope
from tactograph.nodes.light._between_cells import between_cells
from tactograph.nodes.light._coated_bounce import coated_arriving, source_rows
from tactograph.nodes.light._radiosity import (
    BLOCK,
    cell_grid,
    cells_of,
    framed,
    matt_arriving,
    means,
    near_and_far,
    rim_blocks,
)

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import Launch

MOST_ALBEDO = 0.95
CELLS = 4800
"""Most cells of a frame, where none are asked for."""
COAT = "lights", "diffuse", "base", "roughness", "refraction", "camera"
"""What of a film makes its coat."""


@node(
    neutral=0.0,
    tolerance=Close(1e-5, 2e-4, why="sums over all cells, in another order"),
)
def film_bounce(
    light: Light,
    height: Height,
    film: Film,
    pixel: PixelSize,
    before: Light | None = None,
    slope: Slope | None = None,
    *,
    cells: Annotated[int, Interval(ge=1, le=20000)] = CELLS,
    near: Annotated[int, Interval(ge=0, le=8)] = 1,
    share: Annotated[float, Interval(gt=0, le=1)] = 0.5,
) -> Light:
    r"""Return the part of the light that comes from other places of the film.

    A cell of the film that reflects `albedo` of the light E_j that falls on it lights another
    one.  The camera sees all the light of a cell, that of earlier bounces too, so that one sum
    over the cells holds all bounces::

        B(P) = albedo sum_j max(n.d, 0) max(-S_j.d, 0) / (pi |d|^4) E_j,    d = P_j - P

    with n the normal at P and S_j the area vector of cell j (radiosity; Nayar, Ikeuchi and
    Kanade 1991).  E_j is the light relative to the film at rest times the irradiance of the
    film at rest, which falls off with the inverse square and the cosine.  The result is
    relative to the film at rest again; taken off `light`, it leaves what comes from the LED.
    A flat film lights itself nowhere; `film.rim` mm of it surround the frame.  Cells do not hide
    one another.  A film with a coat mirrors light, too (`_coated_bounce`).

    Parameters
    ----------
    light
        K x H x W, as seen, 1 on the film at rest.
    height
        H x W in mm, as the camera sees it (`view_slope`).
    film
        The LEDs' and the film's properties.  Of an `albedo` of 0 the result is 0; 0.95 is the most.
    pixel
        mm per px of `light` and `height`.
    before
        K x H x W, the result of the round before, where height and bounce are found in turns.
    slope
        2 x H x W, of the film, where it is known better than from the differences of a height on
        large pixels.
    cells
        Most cells.  They are squares of as many pixels as it takes, and the result is
        interpolated between them.
    near
        So many blocks of 4 x 4 cells away film counts cell by cell; farther away a block counts
        as one cell, for the sum would grow with the square of the cells' number.
    share
        By how much of the way the result goes from `before` to what this round says: below 1
        it keeps the turns from swinging.

    Returns
    -------
    ndarray
        K x H x W.

    Raises
    ------
    InputError
        If the albedo is none.
    """
    _check(film.albedo)
    if film.albedo == 0:
        return np.zeros_like(light)
    grid = cell_grid(height.shape, pixel, cells, film.rim)
    places, areas, rest = cells_of(height, film.lights, np.float32(pixel), grid, slope, film.camera)
    sources = rest.copy()
    inside = framed(grid)
    sources[:, inside] *= means(light, grid.factor).reshape(len(light), -1)
    gain = np.float32(film.albedo) / np.float32(math.pi)
    arriving = matt_arriving if film.refraction == 1 else coated_arriving(film)
    bounced = gain * near_and_far(places, areas, sources, grid, near, arriving) / rest[:, inside]
    planes = bounced.reshape(len(light), grid.rows, grid.columns)
    found = between_cells(planes, height.shape, grid.factor)
    return found if before is None else before + np.float32(share) * (found - before)


@film_bounce.opencl()
def _launch(run: Launch) -> None:
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    of, settings, out = run.inputs, run.settings, run.outputs["film_bounce"]
    lights, pixel, albedo = (of[name] for name in ("film.lights", "pixel", "film.albedo"))
    constants = {"LEDS": count}
    _check(albedo)
    if albedo == 0:
        work = run.in_lanes(count, *size)
        run.kernel("nothing", work, out, count * math.prod(size), constants=constants)
        return
    grid = cell_grid((size[0], size[1]), pixel, settings["cells"], of["film.rim"])
    cells = math.prod(grid.whole)
    table = run.scratch((6 + 2 * count, cells))
    edge = rim_blocks(grid.rim)
    blocks = math.prod(math.ceil(s / BLOCK) + 2 * edge for s in (grid.rows, grid.columns))
    far = run.scratch((6 + count, blocks))
    bounced = run.scratch((count, grid.rows, grid.columns))
    shape = grid.rows, grid.columns, grid.rim
    local = (run.group,)
    arguments = of["light"], of["height"], of.get("slope"), lights, pixel, table, *size
    arguments = *arguments, grid.factor, *shape, grid.rim_mm, of["film.camera"]
    run.kernel("lay_out", (cells,), *arguments, local=local, constants=constants)
    run.kernel("put_together", (blocks,), table, far, *shape, constants=constants)
    work = run.in_row_lanes(grid.rows, grid.columns)
    rest = *shape, settings["near"], float(np.float32(albedo) / np.float32(math.pi))
    if of["film.refraction"] == 1:
        run.kernel(
            "near_and_far", work, table, far, bounced, *rest, local=local, constants=constants
        )
    else:
        coat = [of[f"film.{name}"] for name in COAT]
        sources = [run.scratch((source_rows(count), number)) for number in (cells, blocks)]
        for plane, sent, number in zip((table, far), sources, (cells, blocks), strict=True):
            arguments = plane, sent, *coat, number
            run.kernel("coat", run.in_lanes(number), *arguments, constants=constants)
        arguments = table, *sources, bounced, *coat, *rest
        run.kernel("coated_near_and_far", work, *arguments, local=local, constants=constants)
    work = run.in_row_lanes(count, *size)
    arguments = bounced, of.get("before"), out, *size, grid.factor, *shape[:2], settings["share"]
    run.kernel("interpolate", work, *arguments, constants=constants)


@film_bounce.example
def _example(rng: np.random.Generator, K: int, **_: int) -> dict[str, Any]:
    """LEDs in front of the film; one in two has no coat."""
    sideways = rng.uniform(-20, 20, (K, 2))
    lights = np.column_stack([sideways, rng.uniform(15, 40, K)]).astype(np.float32)
    matt = {"film.refraction": 1.0} if rng.random() < 1 / 2 else {}
    return {"film.lights": lights, **matt}


def _check(albedo: float) -> None:
    if not 0 <= albedo <= MOST_ALBEDO:
        raise InputError(
            f"film_bounce: albedo is {albedo:g}; give the share of the light that the film "
            f"reflects, 0 to {MOST_ALBEDO:g}"
        )
