"""Look up the slope of each pixel: that of the table entry with the nearest light."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.graph.cores import cores
from tactograph.nodes import F4, U1, Labels, Light, Slope
from tactograph.nodes.slope.index_lut import TOP_ENTRIES, LutIndex, index_lut

CELL_PIXELS = 1024
"""Smallest mean number of pixels in a cell of the sort; the kernel's CELL_PIXELS."""
MAX_LEVELS = 10
CELL_SAMPLES = 8
"""Pixels per cell that are sampled for the medians; the kernel's CELL_SAMPLES."""
SPARSER_LEVELS = 3
"""Levels by which the cells of shadowed pixels are coarser; the kernel's SPARSER_LEVELS."""
CHUNK_COUNT = 64
"""Work-items that share the frame's pixels."""


@node(
    tolerance=Close(
        1e-6, 1e-6, share=1e-3, why="rounding decides between entries that are equally near"
    ),
    sizes={"K": SizeLimit(3, 8, "the tables are for 3 to 8 LEDs")},
)
def lut_nearest(light: Light, shadow: Labels, index: LutIndex) -> Slope:
    """Return the slope of the table entry with the nearest light (sections 3.1 and 3.3).

    A pixel that all LEDs reach is looked up in the table of all lights.  A shadowed pixel is
    looked up in the table without its shadowed LED, or without the darkest one if several are
    shadowed.  Distances are Euclidean, and the search is exact.

    Parameters
    ----------
    light : K x H x W; NaN counts as dark
    shadow : H x W, bit k-1 set where LED k is shadowed
    index : the tables and their search trees

    Returns
    -------
    Slope 2 x H x W; zero where the table is empty.
    """
    # Imported here: it takes 0.2 s, and a look-up on a device does not need it.
    from scipy.spatial import cKDTree

    light = np.nan_to_num(light)
    table = _table_number(light, shadow)
    slope = np.zeros((2, *table.shape), np.float32)
    for number in np.unique(table):
        in_table = table == number
        entries, slopes = _entries(index, number)
        if len(entries) == 0:
            continue
        points = light[:, in_table].T
        if number:
            points[:, number - 1] = 0
        tree = cKDTree(entries, compact_nodes=False, balanced_tree=False)
        _, nearest = tree.query(points, workers=cores())
        slope[:, in_table] = slopes[nearest].T
    return slope


def _table_number(light: F4, shadow: U1) -> NDArray[np.intp]:
    """The table of each pixel: 0 if no LED is shadowed, else the darkest shadowed LED; H x W."""
    shadowed = np.stack([shadow >> k & 1 for k in range(len(light))]) > 0
    darkest = np.where(shadowed, light, np.inf).argmin(axis=0) + 1
    return np.where(shadowed.any(axis=0), darkest, 0)


def _entries(index: LutIndex, number: int) -> tuple[F4, F4]:
    """The light (E x K) and the slope (E x 2) of the entries of one table."""
    tops, _, leaf, first = index.tables[number]
    leaves = slice(leaf, leaf + tops * TOP_ENTRIES)
    numbers = index.numbers[leaves]
    entries = np.zeros((numbers.max(initial=-1) + 1, index.entries.shape[1]), np.float32)
    entries[numbers] = index.entries[leaves]
    return entries, index.slopes[first : first + len(entries)]


@lut_nearest.opencl()
def _launch(run: Launch) -> None:
    """Search one pixel per work-item on a GPU; on a CPU sort the frame by light first."""
    height, width = run.sizes["H"], run.sizes["W"]
    arrays = [run.inputs[name] for name in lut_nearest.inputs]
    constants = {"LIGHTS": run.sizes["K"]}
    if run.lanes == 1:
        out = run.outputs["lut_nearest"]
        arguments = (*arrays, out, height, width)
        run.kernel("lut_nearest", (height, width), *arguments, constants=constants)
    else:
        _launch_sorted(run, arrays, constants)


def _launch_sorted(run: Launch, arrays: list[Any], constants: dict[str, int]) -> None:
    """Sort pixels into cells of similar light, and search each cell in packets of lanes."""
    light, shadow, *index = arrays
    lights, size = run.sizes["K"], run.sizes["H"] * run.sizes["W"]
    levels = min(max((size // CELL_PIXELS).bit_length() - 1, 0), MAX_LEVELS)
    cells = (1 << levels) + (lights << max(levels - SPARSER_LEVELS, 0))

    def launch(kernel: str, items: int, *arguments: Any) -> None:
        run.kernel(kernel, (items,), *arguments, local=(1,), constants=constants)

    samples = run.scratch((CELL_SAMPLES << levels, lights))
    medians = run.scratch((1 << levels,))
    launch("find_medians", 1, light, samples, medians, size, levels)
    cell, counts = run.scratch((size,), np.uint16), run.scratch((CHUNK_COUNT, cells), np.int32)
    launch("find_cells", CHUNK_COUNT, light, shadow, medians, cell, counts, size, levels, cells)
    starts = run.scratch((cells + 1,), np.int32)
    launch("find_starts", 1, counts, starts, CHUNK_COUNT, cells)
    place, sorted_light = run.scratch((size,), np.int32), run.scratch((size, lights))
    launch("sort_pixels", CHUNK_COUNT, light, cell, counts, place, sorted_light, size, cells)
    slopes = run.scratch((size, 2))
    launch("search_cells", cells, sorted_light, starts, *index, slopes, levels)
    launch("put_back", CHUNK_COUNT, slopes, place, run.outputs["lut_nearest"], size)


@lut_nearest.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Tables of random light, with many tops for large images, and labels of every kind."""
    count = 700 if H * W < 5000 else 40_000
    entries = rng.random((count, K)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (count, 2)).astype(np.float32)
    dark = np.where(rng.random(count) < 0.5, 1 << rng.integers(0, K, count), 0)
    lit = (((1 << K) - 1) & ~dark).astype(np.uint8)
    index = index_lut(entries, slopes, lit)
    shadow = np.where(rng.random((H, W)) < 0.5, rng.integers(0, 1 << K, (H, W)), 0)
    values = {f"index.{name}": value for name, value in index._asdict().items()}
    return {**values, "shadow": shadow.astype(np.uint8)}
