"""A bounce of light between the cells of a film.

`film_bounce` computes it once, from what the camera sees; `interreflect` repeats it, beginning
with the light of the LEDs.  Light is relative to that on the film at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tactograph.nodes import F4, Film
from tactograph.nodes.optics.coat import upload_curve
from tactograph.nodes.optics.coated_bounce import coated, source_rows
from tactograph.nodes.optics.radiosity import Cells, Grid
from tactograph.nodes.optics.sweep import Sight, arriving, matt

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tactograph.graph.backends.launch import DeviceArray, Launch


def bounce(
    light: F4,
    film: Film,
    cells: Cells,
    grid: Grid,
    seen: Callable[[int], Sight],
    *,
    from_above: bool = False,
) -> F4:
    """Return the light that cells of `light` throw, both K x rows x columns of the frame.

    `seen` tells what the cells see of one another along an azimuth (`sight`); `from_above` as for
    `coated`.
    """
    frame = slice(None), *grid.frame
    sources = cells.rest.copy()
    sources[frame] *= light
    matt_film = film.refraction == 1
    law = matt(sources) if matt_film else coated(film, cells, sources, grid, from_above)
    bounced = arriving(seen, law, len(light), grid)
    return np.float32(film.albedo) * bounced / cells.rest[frame]


def launch_cells(
    run: Launch,
    grid: Grid,
    constants: Mapping[str, int],
    light: DeviceArray,
    slope: DeviceArray | None,
    lights: DeviceArray,
    camera: float,
) -> DeviceArray:
    """Return a table of the cells of `light` and of the node's height (`radiosity.clh`)."""
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    every, inputs = math.prod(grid.whole), run.inputs
    table = run.scratch((7 + 2 * count, every))
    shape = *size, grid.factor, grid.rows, grid.columns, grid.rim
    arguments = light, inputs["height"], slope, lights, inputs["pixel"], table, *shape, camera
    run.kernel("lay_out", run.in_row_lanes(*grid.whole), *arguments, constants=constants)
    return table


def launch_bounce(
    run: Launch,
    grid: Grid,
    constants: Mapping[str, int],
    table: DeviceArray,
    coat: Sequence[Any],
    camera: float,
    albedo: float,
    out: DeviceArray,
    larger: DeviceArray | None = None,
) -> None:
    """Enqueue `bounce`: from a table of cells to `out`, K x rows x columns.

    `coat` holds the LEDs, then the properties of the film's coat; `COATED` says if it has one.
    `larger` is the result on cells twice as large, by which this one is extrapolated.
    """
    every, sources = math.prod(grid.whole), None
    leds, diffuse, base, roughness, refraction, pupil = coat
    curve = upload_curve(run, roughness, refraction)
    coat = leds, diffuse, curve, base, roughness, refraction, pupil
    if constants["COATED"]:
        sources = run.scratch((source_rows(run.sizes["K"]), every))
        work = run.in_lanes(every)
        run.kernel("coat", work, table, sources, *coat, every, constants=constants)
    shape = grid.rows, grid.columns, grid.rim, grid.width, grid.film
    work = run.in_row_lanes(grid.rows, grid.columns)
    arguments = table, sources, out, *coat, *shape, camera, grid.azimuths, albedo, larger
    run.kernel("throw_light", work, *arguments, local=(run.group,), constants=constants)
